#pragma once

#include <memory>
#include <string>

#include <gtest/gtest.h>

#include "console/live_board.h"
#include "diagnosis/decision/valve_engine.h"
#include "tests/monitor/linear_models.h"

namespace fdi::console {

/// A valve of the linear plant with its engine, shown on a board.
class BoardTest : public testing::Test {
 protected:
  void Show(std::uint64_t from, std::uint64_t to, double offset = 0.0,
            std::uint64_t source = 1, const std::string& valve = "V1") {
    for (std::uint64_t k = from; k < to; ++k) {
      const Sample sample = monitor::PlantSample(k, offset, source);
      board_.OnVerdict(valve, sample,
                       {engine_.Step(sample), models_.get(), false});
    }
  }

  std::shared_ptr<const ModelSet> models_{monitor::SharedLinearModels()};
  ValveEngine engine_{models_};
  LiveBoard board_;
};

}  // namespace fdi::console
