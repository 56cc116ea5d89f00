// A row's result is stored whole or not at all, and parts come together.
#include "storage/models/plant_loops.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "tests/storage/model_set_fixture.h"
#include "tests/storage/temporary_directory.h"

namespace fdi::storage {
namespace {

using ::testing::IsEmpty;

class PlantLoopsTest : public ::testing::Test {
 protected:
  static ValveResult Result(const std::string& name, std::uint32_t seed) {
    ValveResult result;
    result.entry.pattern = name;
    result.models = RandomModelSet(name, 3, seed);
    result.type = [](const ModelSet& saved) {
      return ValveType{.name = "globe", .summary = saved.name};
    };
    PlantLoop loop;
    loop.name = name;
    loop.grade = 1;
    loop.description = "Feed";
    loop.location = "Hall 2";
    loop.document = "DS-1";
    loop.costs = "350 EUR";
    loop.group = "unit 1";
    loop.watch = LoopWatch::kFaults;
    loop.state = LoopState::kOnboarded;
    result.loop = loop;
    return result;
  }

  TemporaryDirectory directory_;
  ModelStore store_{directory_.path() / "models.db", Access::kOccasionalWriter};
};

TEST_F(PlantLoopsTest, AResultIsStoredWhole) {
  const auto saved = store_.Store(Result("FV-1", 1));
  EXPECT_EQ(saved->version, 1);
  ASSERT_EQ(store_.Loops().size(), 1U);
  EXPECT_EQ(static_cast<const ValveIdentity&>(store_.Loops().front()),
            *Result("FV-1", 1).loop);
  EXPECT_EQ(store_.AssignedModelSet("FV-1"), (ModelReference{"FV-1", 1}));
  EXPECT_EQ(store_.FindValve("FV-1")->baseline(), BaselineState::kValid);
  EXPECT_EQ(store_.LoadTemplate("globe").summary, "FV-1");
}

TEST_F(PlantLoopsTest, AResultThatFailsLeavesNothing) {
  ValveResult result = Result("FV-1", 1);
  result.type = [](const ModelSet&) -> ValveType {
    return {.name = "not a name"};
  };
  EXPECT_THROW(store_.Store(result), ConfigError);
  EXPECT_THAT(store_.List(), IsEmpty());
  EXPECT_THAT(store_.Valves(), IsEmpty());
  EXPECT_THAT(store_.Loops(), IsEmpty());
}

TEST_F(PlantLoopsTest, ALoopWithASetStaysWatchedForFaults) {
  store_.Store(Result("FV-1", 1));
  PlantLoop refused = *Result("FV-1", 1).loop;
  refused.state = LoopState::kRefused;
  refused.watch = LoopWatch::kNothing;
  ValveEntry entry;
  entry.pattern = "FV-1";
  store_.PutLoop(refused, entry);
  EXPECT_EQ(store_.Loops().front().watch, LoopWatch::kFaults);
  EXPECT_EQ(store_.AssignedModelSet("FV-1"), (ModelReference{"FV-1", 1}));
}

TEST_F(PlantLoopsTest, PartsComeTogetherOnce) {
  ModelStore part(directory_.path() / "part.db", Access::kOccasionalWriter);
  part.Store(Result("FV-1", 1));
  part.Store(Result("FV-2", 2));
  EXPECT_EQ(store_.TakeLoops(part), 2U);
  EXPECT_EQ(store_.TakeLoops(part), 2U);
  EXPECT_EQ(store_.Loops().size(), 2U);
  EXPECT_EQ(store_.List().size(), 2U);
  EXPECT_EQ(store_.Summary({"FV-2", 1}).content_hash,
            part.Summary({"FV-2", 1}).content_hash);
  EXPECT_EQ(store_.ListTemplates().size(), 1U);
}

}  // namespace
}  // namespace fdi::storage
