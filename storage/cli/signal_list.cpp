#include "storage/cli/signal_list.h"

#include "diagnosis/error.h"

namespace fdi::cli {

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

std::string SignalsText(SignalMask signals) {
  std::string text;
  for (std::size_t i = 0; i < kSignalCount; ++i) {
    const auto signal = static_cast<Signal>(i);
    if ((signals & MaskOf(signal)) != 0) {
      text += (text.empty() ? "" : ",") + std::string(SignalName(signal));
    }
  }
  return text;
}

}  // namespace fdi::cli
