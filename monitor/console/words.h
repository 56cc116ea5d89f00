#pragma once

#include <functional>
#include <string>
#include <string_view>

#include "monitor/console/model_facts.h"
#include "monitor/trace.h"

namespace fdi::console {

/// Plain name of what the diagnosis calls "f19".
using FaultNamer = std::function<std::string(std::string_view)>;

/// What the observers say about an instant, for people:
///
///     "flow 12 m3/h above what the normal model expects; fits: flow
///      transmitter wrong, plug eroded"
///
/// The channel is the one whose normal residual is farthest beyond its
/// threshold, relative to it; faults fit whose factor is at least T/2, the best
/// first. Without a channel beyond its threshold it says so.
std::string Explain(const ModelFacts& models, const monitor::TracePoint& point,
                    const FaultNamer& name);

/// 12.34 as "12", 0.01234 as "0.012": two digits that count.
std::string TwoDigits(double value);

}  // namespace fdi::console
