#include "trainer/app/signal_list.h"

#include "diagnosis/error.h"

namespace fdi::trainer {

SignalMask ParseSignals(const std::vector<std::string>& names) {
  SignalMask signals = 0;
  for (const std::string& name : names) {
    const auto signal = ParseSignal(name);
    if (!signal || (kBasicSignals & MaskOf(*signal)) == 0) {
      throw ConfigError("unknown signal '" + name +
                        "': expected CV, P1, P2, T1, X or F");
    }
    signals = static_cast<SignalMask>(signals | MaskOf(*signal));
  }
  return signals;
}

}  // namespace fdi::trainer
