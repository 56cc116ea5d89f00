#include <cstdio>
#include <fstream>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/resource.h>

#include "base/error.h"
#include "base/passing_error.h"
#include "idl/participant.h"
#include "idl/profile_file.h"
#include "tests/sanitized.h"

namespace fdi::idl {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

auto RefusedAs(const std::string& option, const std::string& value) {
  return ThrowsMessage<ConfigError>(
      AllOf(HasSubstr(option), HasSubstr(value), HasSubstr("accepted")));
}

TEST(DdsOptionsTest, TheDefaultsAreUsable) {
  EXPECT_NO_THROW(Validate(DdsOptions{}));
}

TEST(DdsOptionsTest, EachOptionIsCheckedByNameValueAndRange) {
  DdsOptions options;
  options.domain = 233;
  EXPECT_THAT([&] { Validate(options); }, RefusedAs("--domain", "233"));
  options = {};
  options.transport = "tcp";
  EXPECT_THAT([&] { Validate(options); }, RefusedAs("--transport", "tcp"));
  options = {};
  options.max_valves = 0;
  EXPECT_THAT([&] { Validate(options); }, RefusedAs("--max-valves", "0"));
}

// TEST-NET-1 of RFC 5737: no machine has it.
TEST(DdsOptionsTest, AnAddressThatTheMachineLacksIsRefused) {
  DdsOptions options;
  options.interfaces = "127.0.0.1,192.0.2.7";
  // It may come after us at boot.
  EXPECT_THAT([&] { Validate(options); },
              ThrowsMessage<PassingError>(AllOf(
                  HasSubstr("--interface: '192.0.2.7'"), HasSubstr("127.0"))));
  options.interfaces = "eth0";
  EXPECT_THAT([&] { Validate(options); }, RefusedAs("--interface", "eth0"));
  options.interfaces = "";
  EXPECT_THROW(Validate(options), ConfigError);
  options.interfaces = "all";
  EXPECT_NO_THROW(Validate(options));
}

// Nothing is wrong with the options where no file can be opened.
TEST(DdsOptionsTest, WithoutDescriptorsTheAddressIsNotSaidToBeMissing) {
  if (kSanitized) {
    GTEST_SKIP() << "under a sanitizer";
  }
  rlimit before{};
  getrlimit(RLIMIT_NOFILE, &before);
  const rlimit none{0, before.rlim_max};
  DdsOptions options;
  options.interfaces = "127.0.0.1";
  setrlimit(RLIMIT_NOFILE, &none);
  std::string what;
  try {
    Validate(options);
  } catch (const PassingError& error) {
    what = error.what();
  }
  setrlimit(RLIMIT_NOFILE, &before);
  EXPECT_THAT(what, HasSubstr("cannot be listed: Too many open files"));
}

class ProfileFileTest : public ::testing::Test {
 protected:
  ~ProfileFileTest() override { std::remove(path_.c_str()); }

  std::string Write(const std::string& profiles) {
    std::ofstream(path_) << "<?xml version=\"1.0\"?>\n<profiles xmlns=\"http:"
                            "//www.eprosima.com/XMLSchemas/fastRTPS_Profiles\">"
                         << profiles << "</profiles>";
    return path_;
  }

  const std::string path_ =
      ::testing::TempDir() + "fdi_profile_" +
      ::testing::UnitTest::GetInstance()->current_test_info()->name() + ".xml";
};

TEST_F(ProfileFileTest, AMissingFileIsNamed) {
  EXPECT_THAT([] { ProfileFile("/nowhere/qos.xml"); },
              ThrowsMessage<ConfigError>(HasSubstr("/nowhere/qos.xml")));
}

TEST_F(ProfileFileTest, AParticipantRefusesAMissingFile) {
  DdsOptions options;
  options.qos_file = "/nowhere/qos.xml";
  EXPECT_THAT([&] { Participant participant(options); },
              ThrowsMessage<ConfigError>(HasSubstr("/nowhere/qos.xml")));
}

TEST_F(ProfileFileTest, ATypoInAProfileNameIsAnError) {
  const std::string path = Write(
      "<data_writer profile_name=\"fdi_valve_sampel_writer\"></data_writer>");
  EXPECT_THAT(
      [&] { ProfileFile{path}; },
      ThrowsMessage<ConfigError>(AllOf(HasSubstr("fdi_valve_sampel_writer"),
                                       HasSubstr("fdi_valve_sample_writer"))));
}

TEST_F(ProfileFileTest, APolicyThatWouldBeIgnoredIsAnError) {
  const std::string path = Write(
      "<data_reader profile_name=\"fdi_valve_sample_reader\"><qos><ownership>"
      "<kind>EXCLUSIVE</kind></ownership></qos></data_reader>");
  EXPECT_THAT([&] { ProfileFile{path}; },
              ThrowsMessage<ConfigError>(
                  AllOf(HasSubstr("ownership"),
                        HasSubstr("accepted are reliability durability"),
                        HasSubstr("publishMode times"))));
}

TEST_F(ProfileFileTest, WhatIsNoXmlIsAnError) {
  std::ofstream(path_) << "reliability = best effort";
  EXPECT_THAT([&] { ProfileFile{path_}; },
              ThrowsMessage<ConfigError>(HasSubstr(path_)));
}

TEST_F(ProfileFileTest, KnowsWhichPoliciesAProfileStates) {
  const ProfileFile file(
      Write("<data_writer profile_name=\"fdi_decision_vector_writer\">"
            "<topic><historyQos><depth>3</depth></historyQos></topic>"
            "<qos><publishMode><kind>SYNCHRONOUS</kind></publishMode></qos>"
            "</data_writer>"));

  ASSERT_NE(file.Stated("fdi_decision_vector_writer"), nullptr);
  EXPECT_THAT(*file.Stated("fdi_decision_vector_writer"),
              ::testing::ElementsAre("historyQos", "publishMode"));
  EXPECT_EQ(file.Stated("fdi_decision_vector_reader"), nullptr);
  EXPECT_EQ(file.Stated(kParticipantProfile), nullptr);
}

}  // namespace
}  // namespace fdi::idl
