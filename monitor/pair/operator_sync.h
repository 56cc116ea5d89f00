#pragma once

#include <chrono>
#include <deque>
#include <exception>
#include <filesystem>
#include <string>
#include <thread>

#include "idl/endpoint.h"
#include "monitor/pair/pair.h"
#include "monitor/throttled_log.h"
#include "storage/history/history_editor.h"
#include "storage/history/operator_log.h"

namespace fdi::monitor {

/// Copies operator actions (acknowledgements, labels, shelves) made on one
/// monitor of a pair, by whatever program, into the history of the other. A
/// monitor that was away gets those of the last 30 days when it returns;
/// actions on episodes that it does not have are skipped. Runs a thread of its
/// own.
class OperatorSync {
 public:
  /// @throws idl::TransportError; DataError, storage::SqliteError
  OperatorSync(idl::Participant& participant, const PairOptions& options,
               std::string monitor, const std::filesystem::path& history,
               ThrottledLog& log);

  void Start();
  void Stop() { thread_ = {}; }

 private:
  struct Received {
    std::chrono::steady_clock::time_point since;
    OperatorAction action;
  };

  void SendActions();
  void ApplyReceived();
  void ReportRefusal(const std::exception& error);

  const std::string monitor_;
  storage::OperatorLog local_actions_;
  storage::HistoryEditor history_;
  ThrottledLog& log_;
  idl::Publisher<OperatorAction> out_;
  idl::Subscriber<OperatorAction> in_;
  int seen_readers_{0};
  std::deque<OperatorAction> unsent_;
  std::deque<Received> received_;  // Its episode may still be adopted.
  std::jthread thread_;
};

}  // namespace fdi::monitor
