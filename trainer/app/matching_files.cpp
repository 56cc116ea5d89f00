#include "trainer/app/matching_files.h"

#include <algorithm>
#include <cstdlib>
#include <string_view>

#include "diagnosis/error.h"

namespace fdi::trainer {
namespace {

using std::filesystem::path;

std::string WithVariables(std::string text) {
  for (std::size_t begin = text.find("${"); begin != std::string::npos;
       begin = text.find("${")) {
    const std::size_t end = text.find('}', begin);
    if (end == std::string::npos) {
      throw ConfigError("'" + text + "' lacks a } behind ${");
    }
    const std::string name = text.substr(begin + 2, end - begin - 2);
    const char* value = std::getenv(name.c_str());
    if (value == nullptr || *value == '\0') {
      throw ConfigError("the environment variable " + name + " is not set; '" +
                        text + "' needs it");
    }
    text.replace(begin, end - begin + 1, value);
  }
  return text;
}

// True if `name` is `pattern`, in which a * stands for anything.
bool Matches(std::string_view pattern, std::string_view name) {
  const std::size_t star = pattern.find('*');
  if (star == std::string_view::npos) {
    return pattern == name;
  }
  if (!name.starts_with(pattern.substr(0, star))) {
    return false;
  }
  for (std::size_t skip = star; skip <= name.size(); ++skip) {
    if (Matches(pattern.substr(star + 1), name.substr(skip))) {
      return true;
    }
  }
  return false;
}

}  // namespace

std::vector<path> MatchingFiles(const std::string& pattern,
                                const path& folder) {
  const path given = WithVariables(pattern);
  const path absolute = given.is_absolute() ? given : folder / given;
  const std::string name = absolute.filename().string();
  if (name.find('*') == std::string::npos) {
    return {absolute};
  }
  std::vector<path> files;
  std::error_code error;
  for (const auto& entry : std::filesystem::directory_iterator(
           absolute.has_parent_path() ? absolute.parent_path() : ".", error)) {
    if (Matches(name, entry.path().filename().string())) {
      files.push_back(entry.path());
    }
  }
  if (files.empty()) {
    throw ConfigError("no file is called " + absolute.string());
  }
  std::sort(files.begin(), files.end());
  return files;
}

}  // namespace fdi::trainer
