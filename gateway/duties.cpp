#include "gateway/duties.h"

#include <sstream>

#include <systemd/sd-daemon.h>

namespace fdi::gateway {
namespace {

using Clock = std::chrono::steady_clock;

constexpr std::chrono::seconds kTick(1);
constexpr std::chrono::minutes kCalm(1);
// Subjects that are remembered: a client may make up names without end.
constexpr std::size_t kMaxTold = 10'000;

std::string PageOf(const std::vector<Metric>& metrics) {
  std::ostringstream page;
  page.precision(15);
  for (const Metric& metric : metrics) {
    const std::string name = "fdi_gateway_" + metric.name;
    page << "# HELP " << name << ' ' << metric.help << "\n# TYPE " << name
         << (name.ends_with("_total") ? " counter\n" : " gauge\n") << name
         << ' ' << metric.value << '\n';
  }
  return page.str();
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
  const auto now = Clock::now();
  const std::string key = std::string(event) + ' ' + about;
  auto told = told_.find(key);
  if (told == told_.end() && told_.size() >= kMaxTold) {
    told_.clear();
  }
  if (told == told_.end()) {
    told = told_.emplace(key, Told{}).first;
  } else if (now - told->second.at < kCalm) {
    ++told->second.not_shown;
    return;
  }
  std::string line = EventLine(event, fields);
  if (told->second.not_shown > 0) {
    line += " not_shown=" + std::to_string(told->second.not_shown);
  }
  told->second = {now, 0};
  log_(LogLevel::kWarning, line);
}

}  // namespace fdi::gateway
