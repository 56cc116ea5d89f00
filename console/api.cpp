#include "console/api.h"

#include <algorithm>
#include <cctype>
#include <chrono>
#include <exception>
#include <filesystem>
#include <iterator>
#include <memory>

#include <httplib.h>

#include "base/error.h"
#include "base/text.h"
#include "storage/history/foreign_history.h"
#include "storage/history/history_reader.h"
#include "storage/models/repairs.h"

namespace fdi::console {
namespace {

// For a page that has its style and pictures in itself, and no script.
constexpr const char* kPagePolicy =
    "default-src 'none'; style-src 'unsafe-inline'; base-uri 'none'; "
    "form-action 'none'; frame-ancestors 'none'";

// For requests that need a history on another host.
constexpr std::chrono::seconds kRequestTime{15};
constexpr std::int64_t kLastMs = 9'000'000'000'000;  // year 2255

// Lower-cases a name for the middle of a sentence: "flow transmitter ...", but
// "CV ...".
std::string PlainName(const report::FaultTexts& texts, std::string_view fault) {
  std::string name = texts.Words(fault, 0.0).name;
  if (name.size() > 1 &&
      std::islower(static_cast<unsigned char>(name[1])) != 0) {
    name[0] =
        static_cast<char>(std::tolower(static_cast<unsigned char>(name[0])));
  }
  return name;
}

// The places that a request takes one of; null: it needs none.
std::counting_semaphore<>* PlacesFor(const Api& api, std::string_view path) {
  const bool episode = path.starts_with("/api/v1/episodes/");
  if (episode && (path.ends_with(".svg") || path.ends_with(".png") ||
                  path.ends_with(".html"))) {
    return &api.picture_places;
  }
  constexpr std::string_view kLive[] = {"/api/v1/status", "/api/v1/faults",
                                        "/api/v1/groups"};
  const bool valve =
      path.starts_with("/api/v1/valves") && !path.ends_with("/health");
  return valve || std::ranges::find(kLive, path) != std::end(kLive)
             ? nullptr
             : &api.history_places;
}

// Gives back the place, if there is one.
struct Leave {
  void operator()(std::counting_semaphore<>* places) const {
    places->release();
  }
};

}  // namespace

std::unique_ptr<storage::History> Api::History() const {
  if (!sources.plant_history) {
    return std::make_unique<storage::HistoryReader>(sources.history);
  }
  if (const auto away = alarms.away()) {
    throw storage::HistoryAwayError(away->reason);
  }
  auto history = sources.plant_history();
  if (auto* foreign = dynamic_cast<storage::ForeignHistory*>(history.get())) {
    foreign->FinishWithin(kRequestTime);
  }
  return history;
}

// None where they cannot be read: a trend without them is better than none.
std::vector<storage::ValveEvent> Api::Repairs(
    const std::string& valve_id) const {
  if (sources.plant_history || !std::filesystem::exists(sources.models)) {
    return {};
  }
  try {
    storage::ModelStore store(sources.models);
    return storage::RepairsOf(store, valve_id);
  } catch (const std::exception&) {
    return {};
  }
}

Json RepairsJson(const std::vector<storage::ValveEvent>& repairs,
                 std::int64_t from_ns) {
  Json list = Json::array();
  for (const storage::ValveEvent& repair : repairs) {
    if (repair.at_ns >= from_ns) {
      list.push_back({{"at_ms", Ms(repair.at_ns)},
                      {"kind", storage::ValveEventKindName(repair.kind)},
                      {"who", TextOrNull(repair.who)},
                      {"note", TextOrNull(repair.note)},
                      {"order", TextOrNull(repair.order)}});
    }
  }
  return list;
}

void AddRepairs(const std::vector<storage::ValveEvent>& repairs,
                std::int64_t from_ns, std::int64_t to_ns, Json& marks) {
  for (const storage::ValveEvent& repair : repairs) {
    if (repair.kind != storage::ValveEventKind::kOrdered &&
        repair.at_ns >= from_ns && repair.at_ns <= to_ns) {
      marks.push_back({{"t_ms", Ms(repair.at_ns)},
                       {"kind", storage::ValveEventKindName(repair.kind)},
                       {"text", ""}});
    }
  }
}

Json Api::Words(const ModelFacts* facts, const TracePoint* point) const {
  if (facts == nullptr || point == nullptr) {
    return {};
  }
  return Explain(*facts, *point, [this](std::string_view fault) {
    return PlainName(texts, fault);
  });
}

void Guarded(httplib::Response& response, const std::function<void()>& send) {
  response.set_header("Cache-Control", "no-store");
  try {
    send();
  } catch (const ConfigError& error) {
    SendError(response, 400, error.what());
  } catch (const std::invalid_argument& error) {
    SendError(response, 400, error.what());
  } catch (const NotFoundError& error) {
    SendError(response, 404, error.what());
  } catch (const storage::HistoryAwayError& error) {
    SendError(response, 503, error.what());
  } catch (const storage::SqliteError& error) {
    SendError(response, error.IsBusy() ? 503 : 500, error.what());
  } catch (const std::exception& error) {
    SendError(response, 500, error.what());
  }
}

void AddRoutes(httplib::Server& server, const Api& api,
               std::span<const Route> routes) {
  for (const Route& route : routes) {
    server.Get(route.path, [&api, route](const httplib::Request& request,
                                         httplib::Response& response) {
      std::counting_semaphore<>* const places = PlacesFor(api, request.path);
      if (places != nullptr && !places->try_acquire()) {
        response.set_header("Retry-After", "5");
        return SendError(response, 503, "too many such requests wait already");
      }
      const std::unique_ptr<std::counting_semaphore<>, Leave> place(places);
      Guarded(response, [&] {
        if (route.json) {
          SendJson(response, route.json(api, request));
          return;
        }
        const File file = route.file(api, request);
        if (file.is_page) {
          // Replaces that of the console, whose style is in files.
          response.headers.erase("Content-Security-Policy");
          response.set_header("Content-Security-Policy", kPagePolicy);
        } else {
          response.set_header("Content-Disposition",
                              "attachment; filename=\"" + file.name + "\"");
        }
        response.set_content(file.body, file.type.c_str());
      });
    });
  }
}

Json PlantJson(const Api& api) {
  if (!api.sources.monitors) {
    return {};
  }
  Json list = Json::array();
  for (const MonitorLine& m : api.sources.monitors()) {
    list.push_back({{"monitor", m.name},
                    {"host", m.name.substr(0, m.name.rfind(':'))},
                    {"software", m.software},
                    {"health", TextOrNull(m.health)},
                    {"text", TextOrNull(m.text)},
                    {"valves", m.valves},
                    {"heard_ms", Ms(m.heard_ns)},
                    {"silent", m.silent}});
  }
  Json plant{{"monitors", std::move(list)}, {"history_away", Json()}};
  if (const auto away = api.alarms.away()) {
    plant["history_away"] = {{"since_ms", Ms(away->since_ns)},
                             {"reason", away->reason}};
  }
  return plant;
}

void SendJson(httplib::Response& response, const Json& json) {
  response.set_content(JsonText(json), "application/json");
}

void SendError(httplib::Response& response, int status,
               const std::string& what) {
  response.status = status;
  SendJson(response, {{"error", what}});
}

std::optional<std::string> Parameter(const httplib::Request& request,
                                     const char* name) {
  std::string value = request.get_param_value(name);
  return value.empty() ? std::nullopt
                       : std::optional<std::string>(std::move(value));
}

std::int64_t IntegerParameter(const httplib::Request& request, const char* name,
                              std::int64_t otherwise, std::int64_t minimum,
                              std::int64_t maximum) {
  const std::optional<std::string> text = Parameter(request, name);
  if (!text) {
    return otherwise;
  }
  const auto value = ParseWhole<std::int64_t>(*text);
  if (!value || *value < minimum || *value > maximum) {
    throw ConfigError(std::string(name) + "=" + *text +
                      ": expected a whole number of " +
                      std::to_string(minimum) + ".." + std::to_string(maximum));
  }
  return *value;
}

std::int64_t TimeParameter(const httplib::Request& request, const char* name,
                           std::int64_t otherwise_ns) {
  return Parameter(request, name)
             ? kNsPerMs * IntegerParameter(request, name, 0, 0, kLastMs)
             : otherwise_ns;
}

}  // namespace fdi::console
