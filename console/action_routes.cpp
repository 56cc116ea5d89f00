// Operator actions on alarms, recorded with who, why and from where.
#include <httplib.h>

#include "base/error.h"
#include "base/stamps.h"
#include "base/time_units.h"
#include "console/api.h"
#include "storage/history/alarm.h"
#include "storage/history/history_editor.h"
#include "storage/history/history_reader.h"

namespace fdi::console {
namespace {

constexpr std::int64_t kMaxMinutes = storage::kMaxShelfNs / kNsPerMinute;

std::string TextOf(const Json& body, const char* key) {
  const auto found = body.find(key);
  if (found == body.end() || found->is_null()) {
    return {};
  }
  if (!found->is_string()) {
    throw ConfigError(std::string(key) + ": expected a text");
  }
  return found->get<std::string>();
}

// `body` already holds the name of the user.
storage::OperatorNote NoteOf(const Json& body, const httplib::Request& request,
                             const Api& api) {
  return {TextOf(body, "who"), TextOf(body, "comment"),
          "console " + api.access.AddressOf(request), api.sources.utc_now_ns()};
}

// The current state of the alarm.
Json AlarmRow(const Api& api, const std::string& id) {
  const auto reader = api.History();
  return AlarmJson(
      reader->Alarms({reader->Show(id)}, api.sources.utc_now_ns()).front(),
      api.texts, *api.alarms.Facts());
}

Json Acknowledge(const Api& api, const httplib::Request& request,
                 const Json& body) {
  const std::string id = request.matches[1];
  storage::HistoryEditor(api.sources.history)
      .Acknowledge(id, NoteOf(body, request, api));
  return AlarmRow(api, id);
}

Json Label(const Api& api, const httplib::Request& request, const Json& body) {
  const std::string id = request.matches[1];
  storage::HistoryEditor(api.sources.history)
      .Label(id, TextOf(body, "label"), NoteOf(body, request, api));
  return AlarmRow(api, id);
}

Json Shelve(const Api& api, const httplib::Request& request, const Json& body) {
  const auto minutes = body.find("minutes");
  if (minutes == body.end() || !minutes->is_number() ||
      minutes->get<double>() <= 0.0 ||
      minutes->get<double>() > static_cast<double>(kMaxMinutes)) {
    throw ConfigError("minutes: expected a number above 0, at most " +
                      std::to_string(kMaxMinutes));
  }
  const auto from = body.find("from_ms");
  std::optional<std::int64_t> from_ns;
  if (from != body.end() && !from->is_null()) {
    if (!from->is_number_integer() || from->get<std::int64_t>() < 0 ||
        from->get<std::int64_t>() > kLastStampNs / kNsPerMs) {
      throw ConfigError("from_ms: expected ms since 1970, or null for now");
    }
    from_ns = from->get<std::int64_t>() * kNsPerMs;
  }
  const std::string fault = TextOf(body, "fault");
  const storage::OperatorNote note = NoteOf(body, request, api);
  const auto time_ns = static_cast<std::int64_t>(
      minutes->get<double>() * static_cast<double>(kNsPerMinute));
  return ShelfJson(
      storage::HistoryEditor(api.sources.history)
          .Shelve(TextOf(body, "valve"),
                  fault.empty() ? std::nullopt : std::optional(fault),
                  from_ns.value_or(note.now_ns) + time_ns, note, from_ns));
}

Json EndShelf(const Api& api, const httplib::Request& request,
              const Json& body) {
  try {
    return ShelfJson(storage::HistoryEditor(api.sources.history)
                         .EndShelf(std::stoll(request.matches[1]),
                                   NoteOf(body, request, api)));
  } catch (const DataError& error) {  // It has ended already.
    throw ConfigError(error.what());
  }
}

// The object of the action, for the log.
std::string SubjectOf(const httplib::Request& request, const Json& result) {
  const auto valve = result.find("valve");
  std::string subject = "valve=";
  subject += valve == result.end() ? "-" : valve->dump(-1, ' ', true);
  if (const auto episode = result.find("episode"); episode != result.end()) {
    return subject + " episode=" + request.matches[1].str();
  }
  return subject + " shelf=" + result.value("shelf_id", Json()).dump();
}

struct Action {
  const char* path;
  const char* name;
  Role role;
  Json (*perform)(const Api&, const httplib::Request&, const Json& body);
};

constexpr Action kActions[] = {
    {"/api/v1/episodes/([0-9a-f]{1,16})/ack", "ack", Role::kAcknowledge,
     Acknowledge},
    {"/api/v1/episodes/([0-9a-f]{1,16})/label", "label", Role::kEngineer,
     Label},
    {"/api/v1/shelf", "shelve", Role::kAcknowledge, Shelve},
    {"/api/v1/shelf/([0-9]{1,18})/end", "unshelve", Role::kAcknowledge,
     EndShelf}};

void Perform(const Api& api, const Action& action,
             const httplib::Request& request, httplib::Response& response) {
  if (api.sources.monitors) {
    return SendError(response, 403,
                     "the page of a plant is read-only: use that of the "
                     "monitor, or fdi-store");
  }
  Json body = Json::parse(request.body, nullptr, /*allow_exceptions=*/false);
  const bool named =
      body.is_object() && body.contains("who") && body["who"].is_string();
  std::string who = named ? body["who"].get<std::string>() : "";
  // Checked first: a client without permission learns nothing about the body.
  if (!api.access.Authorize(request, response, action.role, who)) {
    return;
  }
  if (!body.is_object()) {
    throw ConfigError("the body: expected a JSON object");
  }
  if (!who.empty()) {
    body["who"] = who;
  }
  const Json result = action.perform(api, request, body);
  SendJson(response, result);
  api.access.LogAction(request, action.name, SubjectOf(request, result));
  api.stream.Wake();
}

}  // namespace

void AddActionRoutes(httplib::Server& server, const Api& api) {
  for (const Action& action : kActions) {
    server.Post(action.path, [&api, action](const httplib::Request& request,
                                            httplib::Response& response) {
      Guarded(response, [&] { Perform(api, action, request, response); });
    });
  }
}

}  // namespace fdi::console
