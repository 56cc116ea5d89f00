#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "diagnosis/model_set.h"

namespace fdi::console {

/// What people need to know of a model set to read its results.
struct ModelFacts {
  struct Channel {
    std::string name;  ///< "X", "F", ...
    Signal output{Signal::kX};
    std::string unit;
    double low{0.0};   ///< Normal residuals r = y − ŷ below this
    double high{0.0};  ///< or above this are abnormal [unit].
  };
  std::string model_set;  ///< NAME@VERSION
  std::uint64_t hash{0};
  std::vector<Channel> channels;
  std::vector<std::string> faults;  ///< "f19", ... by bit of a FaultSet.
  double isolation_threshold{0.7};  ///< T
  int isolation_samples{20};        ///< t_k
  int detection_samples{2};         ///< n_d
  double period_s{1.0};
  FlowUnit flow_unit{FlowUnit::kM3PerHour};
};

std::shared_ptr<const ModelFacts> FactsOf(const ModelSet& models);

}  // namespace fdi::console
