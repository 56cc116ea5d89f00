// The samples of all valves by one participant, with a reader of one group.
#include "gateway/valve_wire.h"

#include <fstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/idl/dds_fixture.h"
#include "tests/storage/temporary_directory.h"

namespace fdi::gateway {
namespace {

using ::testing::ElementsAre;

class ValveWireTest : public ::testing::Test {
 protected:
  static importer::LiveValve Row(const std::string& id,
                                 const std::string& group) {
    importer::LiveValve valve;
    valve.id = id;
    valve.group = group;
    return valve;
  }
  // Until the reader of group A has as many samples, ends and writers.
  bool Has(std::size_t samples, std::size_t ends, int writers) {
    return idl::TakeUntil(
        reader_,
        {[this](const idl::ValveSampleMessage& message, const auto&) {
           samples_.push_back(message.valve_id);
         },
         [this](const idl::ValveSampleMessage& message, const auto&) {
           ends_.push_back(message.valve_id);
         }},
        [&] {
          return samples_.size() == samples && ends_.size() == ends &&
                 reader_.status().matched == writers;
        });
  }

  const idl::TestDomain domain_;
  storage::TemporaryDirectory directory_;
  report::GlobalOptions options_ = [this] {
    report::GlobalOptions options;
    options.domain = domain_.id();
    options.data_dir = directory_.path();
    return options;
  }();
  idl::LogCapture log_;
  report::Context context_{options_, log_.Sink(), "", ""};
  report::StopSignals signals_;
  idl::Participant participant_{domain_.Options()};
  idl::Subscriber<idl::ValveSampleMessage> reader_{
      participant_, idl::Profile::kLossless, idl::Overflow::kLibrary, {"A"}};
  ValveWire wire_{{2, true, true}, context_, signals_};
  std::vector<std::string> samples_;
  std::vector<std::string> ends_;
};

TEST_F(ValveWireTest, AGroupWithoutAValveHasNoWriter) {
  wire_.Use({Row("V1", "A"), Row("V2", "B")});
  ASSERT_TRUE(Has(0, 0, 1));
  wire_.AwaitReader();
  wire_.Publish("V1", {});
  wire_.Publish("V2", {});
  ASSERT_TRUE(Has(1, 0, 1));
  wire_.Use({Row("V1", "B"), Row("V2", "B")});
  EXPECT_TRUE(Has(1, 1, 0)) << reader_.status().matched << " writers";
  EXPECT_EQ(wire_.readers(), 0);
  wire_.Publish("V1", {});
  wire_.Use({Row("V3", "A"), Row("V2", "B")});
  ASSERT_TRUE(Has(1, 1, 1));
  wire_.AwaitReader();
  wire_.Publish("V3", {});
  EXPECT_TRUE(Has(2, 1, 1));
  EXPECT_THAT(samples_, ElementsAre("V1", "V3"));
  EXPECT_THAT(ends_, ElementsAre("V1"));
}

TEST_F(ValveWireTest, ModelsThatCannotBeReadWithholdNoSample) {
  std::ofstream(directory_.path() / "models.db") << std::string(4096, 'x');
  wire_.Use({Row("V1", "A")});
  ASSERT_TRUE(Has(0, 0, 1));
  wire_.AwaitReader();
  Sample sample;
  sample.Set(Signal::kF, 42.0);
  wire_.Publish("V1", sample);
  EXPECT_TRUE(log_.WaitFor("flow_not_converted valve=V1"));
  EXPECT_TRUE(Has(1, 0, 1));
}

}  // namespace
}  // namespace fdi::gateway
