// What people do to alarms, on record with who, why and from where.
#include <httplib.h>

#include "diagnosis/error.h"
#include "monitor/console/api.h"
#include "storage/history/alarm.h"
#include "storage/history/history_editor.h"
#include "storage/history/history_reader.h"

namespace fdi::console {
namespace {

constexpr std::int64_t kNsPerMinute = 60'000'000'000;
constexpr std::int64_t kMaxMinutes = storage::kLongestShelfNs / kNsPerMinute;

Json BodyOf(const httplib::Request& request) {
  Json body = Json::parse(request.body, nullptr, /*allow_exceptions=*/false);
  if (!body.is_object()) {
    throw ConfigError("the body: expected a JSON object");
  }
  return body;
}

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

storage::OperatorNote NoteOf(const Json& body, const httplib::Request& request,
                             const Api& api) {
  return {TextOf(body, "who"), TextOf(body, "comment"),
          "console " + request.remote_addr, api.sources.utc_now_ns()};
}

// The alarm as it is now.
Json AlarmRow(const Api& api, const std::string& id) {
  storage::HistoryReader reader(api.sources.history);
  return AlarmJson(
      reader.Alarms({reader.Show(id)}, api.sources.utc_now_ns()).front(),
      api.texts);
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
  const std::string fault = TextOf(body, "fault");
  const storage::OperatorNote note = NoteOf(body, request, api);
  const auto time_ns = static_cast<std::int64_t>(
      minutes->get<double>() * static_cast<double>(kNsPerMinute));
  return ShelfJson(
      storage::HistoryEditor(api.sources.history)
          .Shelve(TextOf(body, "valve"),
                  fault.empty() ? std::nullopt : std::optional(fault),
                  note.now_ns + time_ns, note));
}

Json EndShelf(const Api& api, const httplib::Request& request,
              const Json& body) {
  try {
    return ShelfJson(storage::HistoryEditor(api.sources.history)
                         .EndShelf(std::stoll(request.matches[1]),
                                   NoteOf(body, request, api)));
  } catch (const DataError& error) {  // It is over already.
    throw ConfigError(error.what());
  }
}

struct Action {
  const char* path;
  Json (*perform)(const Api&, const httplib::Request&, const Json& body);
};

constexpr Action kActions[] = {
    {"/api/v1/episodes/([0-9a-f]{1,16})/ack", Acknowledge},
    {"/api/v1/episodes/([0-9a-f]{1,16})/label", Label},
    {"/api/v1/shelf", Shelve},
    {"/api/v1/shelf/([0-9]{1,18})/end", EndShelf}};

// @returns whether the request may change anything; if not, it is answered.
bool Admitted(const Api& api, const httplib::Request& request,
              httplib::Response& response) {
  switch (api.access.Check(request.get_header_value("Authorization"),
                           request.remote_addr)) {
    case Permission::kReadOnly:
      SendError(response, 403,
                "this console is read-only: start the monitor with "
                "--console-write FILE");
      return false;
    case Permission::kWrongToken:
      response.set_header("WWW-Authenticate", "Bearer");
      SendError(response, 401,
                "Authorization: expected Bearer and the token of the file "
                "named by --console-write");
      return false;
    case Permission::kTooMany:
      response.set_header("Retry-After", "1");
      SendError(response, 429,
                "too many wrong tokens came from this address: one attempt "
                "per second is looked at");
      return false;
    case Permission::kGranted:
      break;
  }
  return true;
}

}  // namespace

void AddActionRoutes(httplib::Server& server, const Api& api) {
  for (const Action& action : kActions) {
    server.Post(action.path, [&api, action](const httplib::Request& request,
                                            httplib::Response& response) {
      if (Admitted(api, request, response)) {
        Guarded(response, [&] {
          SendJson(response, action.perform(api, request, BodyOf(request)));
          api.stream.Wake();
        });
      }
    });
  }
}

}  // namespace fdi::console
