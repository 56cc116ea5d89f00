// Answers of fdi-store about a component that its build was made without.
#include <gmock/gmock.h>

#include "tests/programs/store/store_program_fixture.h"

namespace fdi::storage {
namespace {

TEST_F(FdiStoreTest, WhatIsLeftOutNamesTheOptionThatBringsItBack) {
  { const HistoryWriter writer(path_); }
  const struct {
    const char* arguments;
    const char* name;
    bool built;
    const char* option;
  } kTable[] = {
      {"worklist --rows 3", "worklist", FDI_PLANNER, "FDI_PLANNER"},
      {"health --valve V1", "health", FDI_PLANNER, "FDI_PLANNER"},
      {"ship --db postgresql:///plant", "ship", FDI_PLANT, "FDI_PLANT"},
      {"history list --db postgresql:///plant", "--db", FDI_PLANT,
       "FDI_PLANT"}};
  for (const auto& row : kTable) {
    if (!row.built) {
      const Outcome outcome = Store(row.arguments);
      EXPECT_EQ(outcome.code, 2) << row.arguments;
      EXPECT_THAT(outcome.err,
                  testing::HasSubstr(std::string(row.name) +
                                     " is not in this build: it takes one that "
                                     "was made with -D" +
                                     row.option + "=ON"));
    }
  }
}

}  // namespace
}  // namespace fdi::storage
