#include "bench/study/model_reduction.h"

#include <algorithm>
#include <cctype>

#include "base/error.h"
#include "diagnosis/model/fault_catalogue.h"

namespace fdi::trainer::study {
namespace {

void Erase(std::vector<int>& from, const std::vector<int>& faults) {
  std::erase_if(from, [&](int fault) { return Contains(faults, fault); });
}

bool SameName(const std::string& a, const std::string& b) {
  return std::equal(a.begin(), a.end(), b.begin(), b.end(), [](char x, char y) {
    return std::tolower(static_cast<unsigned char>(x)) ==
           std::tolower(static_cast<unsigned char>(y));
  });
}

std::ptrdiff_t RequireChannel(const ModelSet& models, const std::string& name) {
  std::string known;
  for (const ChannelSpec& channel : models.channels) {
    if (SameName(channel.name, name)) {
      return &channel - models.channels.data();
    }
    known.append(" ").append(channel.name);
  }
  throw ConfigError("model set " + models.name + " has no channel '" + name +
                    "'; it has" + known);
}

// Nor is a transmitter watched whose channel is gone.
void ClearRepeats(Signal signal, StuckLimits& limits) {
  switch (signal) {
    case Signal::kT1:
      limits.t1 = 0;
      break;
    case Signal::kP1:
      limits.p1 = 0;
      break;
    case Signal::kP2:
      limits.p2 = 0;
      break;
    default:
      break;
  }
}

}  // namespace

ModelSet WithoutFaults(ModelSet models, const std::vector<int>& faults) {
  for (const int fault : faults) {
    if (!Contains(models.faults, fault)) {
      std::string known;
      for (const int other : models.faults) {
        known.append(" ").append(FaultName(other));
      }
      throw ConfigError("model set " + models.name + " does not know " +
                        FaultName(fault) + "; it knows" + known);
    }
  }
  std::erase_if(models.observers, [&](const Observer& observer) {
    return Contains(faults, observer.fault);
  });
  Erase(models.faults, faults);
  Erase(models.undetectable, faults);
  for (std::vector<int>& group : models.groups) {
    Erase(group, faults);
  }
  std::erase_if(models.groups,
                [](const auto& group) { return group.size() < 2; });
  if (!faults.empty()) {
    models.physics.clear();  // It knows them still.
  }
  return models;
}

ModelSet WithoutChannels(ModelSet models,
                         const std::vector<std::string>& names) {
  for (const std::string& name : names) {
    const std::ptrdiff_t index = RequireChannel(models, name);
    if (models.channels.size() == 1) {
      throw ConfigError("model set " + models.name +
                        " would be left without channels");
    }
    ClearRepeats(models.channels[static_cast<std::size_t>(index)].output,
                 models.stuck);
    models.channels.erase(models.channels.begin() + index);
    for (Observer& observer : models.observers) {
      observer.channels.erase(observer.channels.begin() + index);
    }
  }
  return models;
}

ModelSet WithoutParts(ModelSet models, const std::vector<std::string>& parts) {
  for (const std::string& part : parts) {
    if (part == "looks") {
      models.physics.clear();
    } else if (part == "floor") {
      std::erase_if(models.faults, IsFinding);
      models.floor.reset();
    } else if (part == "windows") {
      for (ChannelSpec& channel : models.channels) {
        channel.windows.clear();
      }
    } else {
      models.decision.early_error = 0.0;
    }
  }
  return models;
}

}  // namespace fdi::trainer::study
