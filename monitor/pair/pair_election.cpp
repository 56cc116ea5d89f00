#include "monitor/pair/pair_election.h"

#include <tuple>
#include <utility>

namespace fdi::monitor {

PairElection::PairElection(PairState self, Duration patience,
                           Duration listening, TimePoint now)
    : self_(std::move(self)),
      patience_(patience),
      stepped_(now),
      listen_until_(now + listening) {}

bool PairElection::OnState(const PairState& state, TimePoint now) {
  if (state.pair != self_.pair || state.instance == self_.instance) {
    return false;
  }
  const auto [found, fresh] =
      peers_.try_emplace(state.instance, Peer{state, now, now, std::nullopt});
  Peer& peer = found->second;
  if (state.received != peer.state.received) {
    peer.received = now;
    peer.lagging_since.reset();
  }
  peer.state = state;
  peer.heard = now;
  return true;
}

// A leader that receives nothing while we do is alive and yet has nothing to
// publish. Samples often come in bursts, so ours may arrive somewhat before or
// after the leader's: only a lag of more than half the patience counts.
bool PairElection::IsHealthy(const Peer& peer, TimePoint now) const {
  const bool lagging =
      peer.lagging_since && now - *peer.lagging_since > patience_;
  return !peer.state.leaving && now - peer.heard <= patience_ && !lagging;
}

bool PairElection::Better(const PairState& a, const PairState& b) {
  return std::tuple(-a.judged, a.rank, a.instance) <
         std::tuple(-b.judged, b.rank, b.instance);
}

void PairElection::Step(std::uint64_t received, int judged, TimePoint now) {
  if (now - std::exchange(stepped_, now) > patience_) {
    OnLeaseExpired(now);
  }
  if (std::exchange(self_.received, received) != received) {
    for (auto& [instance, peer] : peers_) {
      if (!peer.lagging_since && now - peer.received > patience_ / 2) {
        peer.lagging_since = now;
      }
    }
  }
  self_.judged = judged;
  leader_.clear();
  same_rank_.clear();
  others_ = 0;
  int better = 0;
  const PairState* rival = nullptr;
  for (const auto& [instance, peer] : peers_) {
    if (!IsHealthy(peer, now)) {
      continue;
    }
    ++others_;
    better += Better(peer.state, self_) ? 1 : 0;
    if (peer.state.rank == self_.rank) {
      same_rank_ = peer.state.monitor;
    }
    if (peer.state.leads && (rival == nullptr || Better(peer.state, *rival))) {
      rival = &peer.state;
    }
  }
  std::erase_if(peers_, [&](const auto& each) {
    return now - each.second.heard > 100 * patience_;
  });
  if (self_.leaving || (rival != nullptr && Better(*rival, self_))) {
    self_.leads = false;
  }
  if (rival != nullptr || self_.leads || now < listen_until_) {
    leaderless_.reset();
  } else {
    leaderless_ = leaderless_.value_or(now);
    self_.leads = !self_.leaving && now - *leaderless_ >= better * patience_;
  }
  if (self_.leads) {
    leader_ = self_.monitor;
  } else if (rival != nullptr) {
    leader_ = rival->monitor;
  }
}

void PairElection::OnLeaseExpired(TimePoint now) {
  self_.leads = false;
  listen_until_ = now + patience_;
}

void PairElection::StepDown(TimePoint now) {
  Step(self_.received, self_.judged, now);
  if (others_ > 0) {
    self_.leaving = true;
    self_.leads = false;
  }
}

}  // namespace fdi::monitor
