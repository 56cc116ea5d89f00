#pragma once

#include <memory>
#include <optional>
#include <string>

#include "simulator/app/sample_publisher.h"
#include "simulator/app/speed.h"
#include "storage/cli/program.h"

namespace fdi::simulator {

void AddRunVerb(cli::Program& program);
void AddReplayVerb(cli::Program& program);
void AddFaultsVerb(cli::Program& program);

/// What `run` and `replay` have in common.
struct DeliveryOptions {
  std::optional<std::string> speed;
  std::optional<double> wait_reader_s;
  bool keep_alive{false};
  std::string start;  ///< RFC 3339, or empty: now.
};

void AddDeliveryOptions(CLI::App& verb, DeliveryOptions& options);

/// At max, the reader paces the writer and there must be one.
SamplePublisherOptions PublisherOptionsOf(const DeliveryOptions& options,
                                          Speed speed);

/// options.start, or now to the millisecond. @throws ConfigError
std::int64_t StartOf(const DeliveryOptions& options);

/// @throws ConfigError unless `valve_id` may name a valve.
void RequireValveId(const std::string& valve_id);

}  // namespace fdi::simulator
