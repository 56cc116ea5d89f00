#include "storage/history/certainty.h"

#include <cmath>
#include <cstdio>

#include "base/text.h"
#include "storage/history/sql.h"

namespace fdi::storage {

namespace sql = history_sql;

namespace {

// "f6 or f18"
std::string OrText(std::string faults) {
  for (std::size_t bar = 0;
       (bar = faults.find('|', bar)) != std::string::npos;) {
    faults.replace(bar, 1, " or ");
  }
  return faults;
}

// "1.4 times", "40 times": more digits would say more than a fit knows.
std::string TimesText(double times) {
  constexpr double kMost = 1000.0;
  constexpr double kDigits = 10.0;
  if (times > kMost) {
    return "more than 1000 times";
  }
  char text[32];
  std::snprintf(text, sizeof text,
                times < kDigits ? "%.1f times" : "%.0f times", times);
  return text;
}

}  // namespace

Certainty CertaintyOf(const Episode& episode) {
  const bool outside =
      episode.unknown_kind == UnknownName(Unknown::kOutsideKnown);
  // An episode that ended unnamed is "unknown", whether a fault fitted or not.
  const std::string faults = IsNamed(episode) ? *episode.fault : "";
  return WithAudit(
      WithLookAlikes(fdi::CertaintyOf(
                         faults, ParseLayer(episode.layer.value_or("")),
                         episode.peak_factor,
                         outside ? Unknown::kOutsideKnown : Unknown::kTooEarly),
                     LookAlikesOf(episode)),
      faults, episode.audit.value_or(""));
}

std::string WitnessText(const Episode& episode) {
  std::string text;
  const std::string layer = episode.layer.value_or("");
  const std::string fault = episode.fault.value_or("");
  if (IsNamed(episode) && layer == LayerName(Layer::kPhysics)) {
    text = "named by simulation of the valve";
    if (episode.rival && episode.rival_times) {
      text += ": " + OrText(fault) + " explains it " +
              TimesText(*episode.rival_times) + " better than " +
              *episode.rival;
    }
    if (episode.observers) {
      text += episode.observers->empty() ? ", the observers are undecided"
              : *episode.observers == fault
                  ? ", the observers agree"
                  : ", the observers say " + OrText(*episode.observers);
    }
  } else if (IsNamed(episode) && layer == LayerName(Layer::kAudit)) {
    text = "named by the audit of the loop";
  }
  if (const auto audit = ParseFinding(episode.audit.value_or(""))) {
    text += (text.empty() ? "" : "; ") +
            ("the audit of its loop says: " +
             std::string(FaultFactsOf(*audit).description));
  }
  return text;
}

std::vector<std::string> LookAlikesOf(const Episode& episode) {
  return LookAlikesBeside(episode.fault.value_or(""),
                          ParseLayer(episode.layer.value_or("")),
                          episode.strength, episode.known);
}

void StoreCertainty(Database& database, const std::string& episode_id) {
  Episode episode;
  Statement& row = database.Cached(sql::what_is_certain).Bind(episode_id);
  if (!row.Step()) {
    return;
  }
  row.Read(0, episode.fault, episode.unknown_kind, episode.layer,
           episode.peak_factor, episode.strength, episode.known, episode.audit);
  row.Reset();
  const std::string look_alikes = JoinText(LookAlikesOf(episode), "|");
  database.Cached(sql::set_certainty)
      .Bind(CertaintyName(CertaintyOf(episode)),
            look_alikes.empty() ? std::nullopt : std::optional(look_alikes),
            episode_id)
      .Run();
}

std::string_view NoNameText(const Episode& episode) {
  if (IsNamed(episode) || CertaintyOf(episode) == Certainty::kNotKnown) {
    return "";
  }
  return episode.isolated_ns ? "Fault whose name was withdrawn"
         : episode.ended_ns && !episode.unconfirmed_ns
             ? "Fault that ended before it had a name"
             : "Fault without a name yet";
}

}  // namespace fdi::storage
