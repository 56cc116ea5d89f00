#include "diagnosis/error.h"
#include "diagnosis/fault_catalogue.h"
#include "storage/history_reader.h"
#include "storage/history_rows.h"
#include "storage/history_schema.h"

namespace fdi::storage {
namespace {

std::string CheckedLabel(std::string_view label) {
  if (label == "true" || label == "false") {
    return std::string(label);
  }
  const auto fault = ParseFault(label);
  if (!fault) {
    throw ConfigError("unknown label '" + std::string(label) +
                      "'; accepted are true, false and " +
                      std::string(kFaultNames));
  }
  return FaultName(*fault);
}

std::optional<std::string> Optional(std::string_view text) {
  return text.empty() ? std::nullopt : std::optional<std::string>(text);
}

}  // namespace

HistoryEditor::HistoryEditor(const std::filesystem::path& path)
    : database_(path, HistorySchema(), Access::kOccasionalWriter) {}

void HistoryEditor::Acknowledge(std::string_view id, std::string_view who,
                                std::string_view comment, std::int64_t now_ns) {
  Require(!who.empty(), "HistoryEditor::Acknowledge: who is empty");
  Transaction transaction(database_);
  const std::string episode = EpisodeIdText(ResolveEpisode(database_, id));
  database_.Run(
      "UPDATE episode SET acked_by = ?, acked_ns = ? WHERE episode_id = ?", who,
      now_ns, episode);
  database_.Run(
      "INSERT INTO episode_event (episode_id, kind, stamp_ns, recorded_ns, "
      "who, comment) VALUES (?, 'ACK', ?, ?, ?, ?)",
      episode, now_ns, now_ns, who, Optional(comment));
  transaction.Commit();
}

void HistoryEditor::Label(std::string_view id, std::string_view label,
                          std::string_view who, std::string_view comment,
                          std::int64_t now_ns) {
  Require(!who.empty(), "HistoryEditor::Label: who is empty");
  const std::string value = CheckedLabel(label);
  Transaction transaction(database_);
  const std::string episode = EpisodeIdText(ResolveEpisode(database_, id));
  database_.Run("UPDATE episode SET label = ? WHERE episode_id = ?", value,
                episode);
  database_.Run(
      "INSERT INTO episode_event (episode_id, kind, stamp_ns, recorded_ns, "
      "value, who, comment) VALUES (?, 'LABEL', ?, ?, ?, ?, ?)",
      episode, now_ns, now_ns, value, who, Optional(comment));
  transaction.Commit();
}

}  // namespace fdi::storage
