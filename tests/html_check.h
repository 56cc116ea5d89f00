#pragma once

#include <algorithm>
#include <cctype>
#include <cstddef>
#include <set>
#include <string>
#include <vector>

namespace fdi {

/// The tags of a page that close what is not open, or stay open, or never end.
/// Void elements need no end.
inline std::vector<std::string> MalformedTags(const std::string& html) {
  static const std::set<std::string> kVoid{"meta", "br", "hr", "img", "link"};
  std::vector<std::string> open;
  std::vector<std::string> faults;
  std::size_t at = html.find("<html");
  for (; at < html.size(); at = html.find('<', at)) {
    const bool closes = html[at + 1] == '/';
    const std::size_t begin = at + (closes ? 2 : 1);
    std::size_t end = begin;
    while (std::isalnum(static_cast<unsigned char>(html[end])) != 0) {
      ++end;
    }
    const std::string name = html.substr(begin, end - begin);
    char quote = '\0';
    for (; end < html.size() && (quote != '\0' || html[end] != '>'); ++end) {
      const char c = html[end];
      if (c == '"' || c == '\'') {
        quote = quote == '\0' ? c : quote == c ? '\0' : quote;
      } else if (c == '<') {
        break;
      }
    }
    if (name.empty() || end >= html.size() || html[end] != '>') {
      faults.push_back(html.substr(at, 40));
    } else if (!closes) {
      if (html[end - 1] != '/' && !kVoid.contains(name)) {
        open.push_back(name);
      }
    } else if (open.empty() || open.back() != name) {
      faults.push_back("</" + name + ">");
    } else {
      open.pop_back();
    }
    at = std::max(end, at + 1);
  }
  faults.insert(faults.end(), open.begin(), open.end());
  return faults;
}

}  // namespace fdi
