#include "cli/output_folder.h"

#include <filesystem>
#include <fstream>

#include <gmock/gmock.h>
#include <unistd.h>

#include "diagnosis/error.h"
#include "tests/storage/temporary_directory.h"

namespace fdi::cli {
namespace {

using storage::TemporaryDirectory;
using testing::HasSubstr;

template <typename Action>
std::string MessageOf(const Action& action) {
  try {
    action();
  } catch (const DataError& error) {
    return error.what();
  }
  return "nothing thrown";
}

TEST(OutputFolderTest, FolderIsMadeOnlyWithinOneThatIsThere) {
  const TemporaryDirectory directory;
  const auto folder = directory.path() / "report";
  EnsureFolder(folder);
  EnsureFolder(folder);
  EXPECT_TRUE(std::filesystem::is_directory(folder));
  EXPECT_THAT(
      MessageOf([&] { EnsureFolder(directory.path() / "no" / "report"); }),
      HasSubstr("there is no folder " + (directory.path() / "no").string()));
  std::ofstream(directory.path() / "file") << "x";
  EXPECT_THAT(MessageOf([&] { EnsureFolder(directory.path() / "file"); }),
              HasSubstr((directory.path() / "file").string()));
}

TEST(OutputFolderTest, FolderWithoutPermissionIsNamed) {
  if (geteuid() == 0) {
    GTEST_SKIP() << "root may write anywhere";
  }
  const TemporaryDirectory directory;
  const auto folder = directory.path() / "closed";
  EnsureFolder(folder);
  std::filesystem::permissions(folder, std::filesystem::perms::owner_read);
  EXPECT_THAT(MessageOf([&] { EnsureFolder(folder); }),
              HasSubstr(folder.string()));
  std::filesystem::permissions(folder, std::filesystem::perms::owner_all);
}

TEST(OutputFolderTest, FileThatCannotBeWrittenIsNamedAndLeavesNoPart) {
  const TemporaryDirectory directory;
  std::filesystem::create_directory(directory.path() / "taken");
  EXPECT_THAT(MessageOf([&] { WriteFile(directory.path() / "taken", "x"); }),
              HasSubstr((directory.path() / "taken").string()));
  EXPECT_FALSE(std::filesystem::exists(directory.path() / "taken.part"));
}

}  // namespace
}  // namespace fdi::cli
