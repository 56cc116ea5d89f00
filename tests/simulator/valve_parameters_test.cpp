#include "simulator/valve_parameters.h"

#include <functional>
#include <limits>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"

namespace fdi::simulator {
namespace {

using testing::HasSubstr;

TEST(ValveParametersTest, EveryNamedSetIsValidAndCarriesItsName) {
  for (const std::string& name : ParameterSetNames()) {
    EXPECT_EQ(ParameterSet(name).name, name);
    EXPECT_NO_THROW(Validate(ParameterSet(name)));
  }
}

TEST(ValveParametersTest, UnknownSetNamesTheKnownOnes) {
  try {
    ParameterSet("lublin");
    FAIL();
  } catch (const ConfigError& error) {
    EXPECT_THAT(error.what(), HasSubstr("'lublin'"));
    for (const std::string& name : ParameterSetNames()) {
      EXPECT_THAT(error.what(), HasSubstr(name));
    }
  }
}

TEST(ValveParametersTest, MessagesNameFieldValueAndRange) {
  const auto message = [](const std::function<void(ValveParameters&)>& edit) {
    ValveParameters parameters;
    edit(parameters);
    try {
      Validate(parameters);
    } catch (const ConfigError& error) {
      return std::string(error.what());
    }
    return std::string();
  };
  EXPECT_THAT(message([](auto& p) { p.actuator.stroke_m = -1.0; }),
              testing::AllOf(HasSubstr("actuator.stroke_m"), HasSubstr("-1"),
                             HasSubstr("0.001 to 1")));
  EXPECT_THAT(message([](auto& p) {
                p.positioner.gain = std::numeric_limits<double>::quiet_NaN();
              }),
              HasSubstr("positioner.gain is nan"));
  EXPECT_THAT(message([](auto& p) { p.trim.kv_m3_h = 0.0; }),
              HasSubstr("trim.kv_m3_h"));
  EXPECT_THAT(message([](auto& p) { p.instruments.flow.high = -1.0; }),
              HasSubstr("instruments.flow.high"));
  EXPECT_THAT(message([](auto& p) { p.instruments.resolution_bits = 0; }),
              HasSubstr("instruments.resolution_bits is 0"));
  EXPECT_EQ(message([](auto&) {}), "");
}

}  // namespace
}  // namespace fdi::simulator
