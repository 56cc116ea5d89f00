#include <sstream>

#include "fdi_store_examples.h"
#include "programs/store/verbs.h"

namespace fdi::storage {

// examples.txt, which the build embeds as kExamples:
//
//     history list                      a verb, group or, "-", the program
//       What happened since yesterday   what an example is for
//         fdi-store history list ...    its command
std::vector<report::VerbExamples> Examples() {
  std::vector<report::VerbExamples> all;
  std::istringstream lines{kExamples};
  for (std::string line; std::getline(lines, line);) {
    const std::size_t indent = line.find_first_not_of(' ');
    if (indent == 0) {
      all.push_back({line == "-" ? "" : line, {}});
    } else if (indent == 2) {
      all.back().examples.push_back({line.substr(indent), ""});
    } else {
      all.back().examples.back().command = line.substr(indent);
    }
  }
  return all;
}

}  // namespace fdi::storage
