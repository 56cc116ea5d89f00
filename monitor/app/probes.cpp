#include "monitor/app/probes.h"

#include <chrono>
#include <utility>

#include <nlohmann/json.hpp>

namespace fdi::monitor {
namespace {

HttpPage Answer(bool good, const nlohmann::ordered_json& body) {
  return {good ? 200 : 503, "application/json", body.dump() + "\n"};
}

HttpPage HealthPage(const Heartbeat& heartbeat) {
  const auto stalled =
      heartbeat.StalledSince(Pulse::Clock::now() - kStallLimit);
  return Answer(stalled.empty(),
                {{"healthy", stalled.empty()}, {"stalled", stalled}});
}

HttpPage ReadinessPage(const Readiness& readiness) {
  return Answer(readiness.ready(), {{"ready", readiness.ready()},
                                    {"model_sets", readiness.model_sets},
                                    {"databases", readiness.databases},
                                    {"publishers", readiness.publishers}});
}

}  // namespace

HttpServer::Pages ProbePages(const Heartbeat& heartbeat, ProbeSources sources) {
  return {{"/metrics",
           [metrics = std::move(sources.metrics)] {
             return HttpPage{200, "text/plain; version=0.0.4; charset=utf-8",
                             metrics()};
           }},
          {"/healthz", [&heartbeat] { return HealthPage(heartbeat); }},
          {"/readyz", [readiness = std::move(sources.readiness)] {
             return ReadinessPage(readiness());
           }}};
}

}  // namespace fdi::monitor
