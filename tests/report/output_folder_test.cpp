#include "report/output_folder.h"

#include <filesystem>
#include <fstream>

#include <fcntl.h>
#include <gmock/gmock.h>
#include <sys/stat.h>
#include <unistd.h>

#include "base/error.h"
#include "tests/storage/temporary_directory.h"

namespace fdi::report {
namespace {

using storage::TemporaryDirectory;
using testing::HasSubstr;

template <typename Action>
std::string ErrorOf(const Action& action) {
  try {
    action();
  } catch (const DataError& error) {
    return error.what();
  }
  return "nothing thrown";
}

TEST(OutputFolderTest, FileThatCannotBeWrittenIsNamedAndLeavesNoPart) {
  const TemporaryDirectory directory;
  std::filesystem::create_directory(directory.path() / "taken");
  EXPECT_THAT(ErrorOf([&] { WriteFile(directory.path() / "taken", "x"); }),
              HasSubstr((directory.path() / "taken").string()));
  EXPECT_FALSE(std::filesystem::exists(directory.path() / "taken.part"));
}

TEST(OutputFolderTest, PipeIsWrittenToAndStaysOne) {
  const TemporaryDirectory directory;
  const auto pipe = directory.path() / "pipe";
  ASSERT_EQ(mkfifo(pipe.c_str(), 0600), 0);
  const int reader = open(pipe.c_str(), O_RDONLY | O_NONBLOCK);
  ASSERT_GE(reader, 0);

  WriteFile(pipe, "text");

  char text[8] = {};
  EXPECT_EQ(read(reader, text, sizeof text), 4);
  EXPECT_STREQ(text, "text");
  EXPECT_TRUE(std::filesystem::is_fifo(pipe));
  close(reader);
}

TEST(OutputFolderTest, LinkStaysOne) {
  const TemporaryDirectory directory;
  const auto file = directory.path() / "file";
  const auto link = directory.path() / "link";
  std::ofstream(file) << "old";
  std::filesystem::create_symlink(file, link);

  WriteFile(link, "newer");

  EXPECT_TRUE(std::filesystem::is_symlink(link));
  EXPECT_EQ(std::filesystem::file_size(file), 5U);
}

}  // namespace
}  // namespace fdi::report
