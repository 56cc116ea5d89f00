// The stream of server-sent events.
#include <httplib.h>

#include "monitor/console/api.h"

namespace fdi::console {
namespace {

constexpr std::chrono::milliseconds kPingPeriod{5000};
constexpr std::size_t kMaxIdLength = 64;

bool WriteNext(StreamClient& client, httplib::DataSink& sink) {
  StreamClient::Message message;
  switch (client.Next(kPingPeriod, message)) {
    case StreamClient::Outcome::kMessage:
      return sink.write(message->data(), message->size());
    case StreamClient::Outcome::kTimeout:
      return sink.write(": ping\n\n", 8);
    case StreamClient::Outcome::kEnded:
      break;
  }
  return false;
}

void Stream(const Api& api, const httplib::Request& request,
            httplib::Response& response) {
  const std::string valve = Parameter(request, "valve").value_or("");
  if (valve.size() > kMaxIdLength) {
    SendError(response, 400, "valve: expected an id of 1..64 bytes");
    return;
  }
  // What comes after hello is told, so that a trend asked for then fits on.
  const auto trend = api.board.Trend(valve, 0);
  const auto client = api.hub.Admit(
      {valve, trend ? trend->next : 0},
      StreamEvent("hello", Dump({{"now_ms", Ms(api.sources.utc_now_ns())},
                                 {"instance", api.instance}})));
  if (!client) {
    response.set_header("Retry-After", "5");
    SendError(response, 503, "all places for live streams are taken");
    return;
  }
  response.set_header("Cache-Control", "no-store");
  response.set_chunked_content_provider(
      "text/event-stream",
      [client](std::size_t /*offset*/, httplib::DataSink& sink) {
        return WriteNext(*client, sink);
      },
      [&hub = api.hub, client](bool /*success*/) { hub.Release(client); });
}

}  // namespace

void AddStreamRoute(httplib::Server& server, const Api& api) {
  server.Get("/api/v1/stream", [&api](const httplib::Request& request,
                                      httplib::Response& response) {
    Stream(api, request, response);
  });
}

}  // namespace fdi::console
