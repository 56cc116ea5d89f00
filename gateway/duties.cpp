#include "gateway/duties.h"

#include <systemd/sd-daemon.h>

#include "monitor/counters.h"

namespace fdi::gateway {
namespace {

using Clock = std::chrono::steady_clock;

constexpr std::chrono::seconds kTick(1);
// A client may make up names of any length.
constexpr std::size_t kLongestLine = 1024;

std::string PageOf(const std::vector<Metric>& metrics) {
  monitor::Exposition page;
  for (const Metric& metric : metrics) {
    using Type = monitor::Exposition::Type;
    page.Family("fdi_gateway_" + metric.name,
                metric.name.ends_with("_total") ? Type::kCounter : Type::kGauge,
                metric.help);
    page.Value(metric.value);
  }
  return page.text();
}

}  // namespace

Duties::Duties(const std::string& address) {
  if (address.empty()) {
    return;
  }
  server_ = std::make_unique<monitor::HttpServer>(monitor::HttpServerOptions{
      .address = monitor::ParseHttpAddress(address, "--http"), .threads = 2});
  server_->Add(
      {{"/metrics",
        [this] {
          const MutexLock lock(mutex_);
          return monitor::HttpPage{
              200, "text/plain; version=0.0.4; charset=utf-8", metrics_};
        }},
       {"/tags",
        [this] {
          const MutexLock lock(mutex_);
          return monitor::HttpPage{200, "application/json", tags_};
        }},
       {"/healthz", [] {
          return monitor::HttpPage{200, "text/plain; charset=utf-8", "ok\n"};
        }}});
}

void Duties::Ready(const std::string& status) {
  if (server_) {
    server_->Start();
  }
  sd_notify(0, ("READY=1\nSTATUS=" + status).c_str());
}

bool Duties::Tick(const std::function<std::vector<Metric>()>& metrics,
                  const std::function<std::string()>& tags) {
  const auto now = Clock::now();
  if (now - ticked_ < kTick) {
    return false;
  }
  ticked_ = now;
  sd_notify(0, "WATCHDOG=1");
  if (server_) {
    std::string page = PageOf(metrics());
    std::string document = tags ? tags() : "{}\n";
    const MutexLock lock(mutex_);
    metrics_ = std::move(page);
    tags_ = std::move(document);
  }
  return true;
}

void CalmLog::Warn(
    std::string_view event, const std::string& about,
    std::initializer_list<std::pair<std::string_view, std::string>> fields) {
  std::uint64_t not_shown = 0;
  monitor::LogLimit& limit =
      limits_
          .try_emplace(std::string(event),
                       monitor::LogLimitOptions{1, std::chrono::minutes(1)})
          .first->second;
  if (!limit.Admit(about.substr(0, kLongestLine), not_shown)) {
    return;
  }
  std::string line = EventLine(event, fields).substr(0, kLongestLine);
  if (not_shown > 0) {
    line += " not_shown=" + std::to_string(not_shown);
  }
  log_(LogLevel::kWarning, line);
}

}  // namespace fdi::gateway
