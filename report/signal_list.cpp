#include "report/signal_list.h"

#include <sstream>

#include "base/error.h"
#include "base/text.h"

namespace fdi::report {

SignalMask ParseSignals(const std::vector<std::string>& names,
                        SignalMask accepted) {
  SignalMask signals = 0;
  for (const std::string& name : names) {
    const auto signal = ParseSignal(name);
    if (!signal || (accepted & MaskOf(*signal)) == 0) {
      throw ConfigError("unknown signal '" + name + "': expected " +
                        SignalsText(accepted));
    }
    signals = static_cast<SignalMask>(signals | MaskOf(*signal));
  }
  return signals;
}

SignalMask ParseSignals(std::string_view list) {
  std::vector<std::string> names;
  // With the trailing comma an empty list is one empty name, which is rejected.
  std::istringstream text(std::string(list) + ',');
  for (std::string name; std::getline(text, name, ',');) {
    names.push_back(name);
  }
  constexpr SignalMask kAll = (1U << kSignalCount) - 1U;
  return ParseSignals(names, kAll);
}

Json SignalsJson(SignalMask signals) {
  Json names = Json::array();
  for (std::size_t i = 0; i < kSignalCount; ++i) {
    const auto signal = static_cast<Signal>(i);
    if ((signals & MaskOf(signal)) != 0) {
      names.push_back(std::string(SignalName(signal)));
    }
  }
  return names;
}

std::string SignalsText(SignalMask signals) {
  return JoinText(SignalsJson(signals).get<std::vector<std::string>>(), ",");
}

}  // namespace fdi::report
