#pragma once

#include <bit>
#include <fstream>
#include <sstream>
#include <string>
#include <vector>

#include <fcntl.h>
#include <spawn.h>
#include <sys/wait.h>

#include "plant/plant_database.h"
#include "tests/storage/history_fixture.h"
#include "tests/storage/private_postgres.h"

namespace fdi::storage {

/// A server for all tests, a database with the plant's history for each.
class PlantFixture : public HistoryFixture {
 protected:
  struct Outcome {
    int code{-1};
    std::string out;
    std::string err;
  };

  static void SetUpTestSuite() {
    if (PrivatePostgres::IsInstalled()) {
      server_ = new PrivatePostgres;
    }
  }
  void SetUp() override {
    if (server_ == nullptr) {
      GTEST_SKIP() << "no PostgreSQL (Debian: apt install postgresql)";
    }
    static int count = 0;
    database_ = "plant" + std::to_string(++count);
    server_->Create(database_);
  }
  static void TearDownTestSuite() {
    delete server_;
    server_ = nullptr;
  }

  static std::string Slurp(const std::filesystem::path& path) {
    std::ostringstream text;
    text << std::ifstream(path, std::ios::binary).rdbuf();
    return text.str();
  }
  std::filesystem::path Folder(const std::string& name) const {
    const auto folder = directory_.path() / name;
    std::filesystem::create_directories(folder);
    return folder;
  }
  std::string Url(const std::string& user = "postgres") const {
    return server_->Url(database_, user);
  }

  Outcome Store(const std::string& arguments) const {
    const auto out = directory_.path() / "out.txt";
    const auto err = directory_.path() / "err.txt";
    const std::string command = "TZ=UTC \"" FDI_STORE_PROGRAM "\" " +
                                arguments + " >" + out.string() + " 2>" +
                                err.string();
    const int status = std::system(command.c_str());
    return {WIFEXITED(status) ? WEXITSTATUS(status) : -1, Slurp(out),
            Slurp(err)};
  }
  Outcome Ship(const std::string& folder, const std::string& more = "",
               const std::string& user = "postgres") const {
    return Store("ship --data " + (directory_.path() / folder).string() +
                 " --monitor " + folder + " --db '" + Url(user) + "' " + more);
  }
  void Init() const {
    const Outcome outcome = Store("ship --init --db '" + Url() + "'");
    ASSERT_EQ(outcome.code, 0) << outcome.err;
  }

  // A program of its own, for kill(2); stderr goes to `log`.
  pid_t Spawn(std::vector<std::string> arguments,
              const std::filesystem::path& log) const {
    arguments.insert(arguments.begin(), FDI_STORE_PROGRAM);
    std::vector<char*> raw;
    for (std::string& argument : arguments) {
      raw.push_back(argument.data());
    }
    raw.push_back(nullptr);
    posix_spawn_file_actions_t actions;
    posix_spawn_file_actions_init(&actions);
    posix_spawn_file_actions_addopen(&actions, 1, "/dev/null", O_WRONLY, 0);
    posix_spawn_file_actions_addopen(&actions, 2, log.c_str(),
                                     O_WRONLY | O_CREAT | O_APPEND, 0600);
    pid_t pid = 0;
    posix_spawn(&pid, raw[0], &actions, nullptr, raw.data(), environ);
    posix_spawn_file_actions_destroy(&actions);
    return pid;
  }

  // Rows as text, a column after the other, numbers as their bits.
  static std::vector<std::string> SqliteRows(
      const std::filesystem::path& history, const std::string& sql) {
    Database database(history, HistorySchema(), Access::kReader);
    Statement row = database.Prepare(sql);
    std::vector<std::string> rows;
    while (row.Step()) {
      std::string text;
      for (int c = 0; c < row.ColumnCount(); ++c) {
        text +=
            "|" + (row.IsNull(c)                        ? "NULL"
                   : row.TypeOf(c) == ColumnType::kReal ? Bits(row.Double(c))
                                                        : row.Text(c));
      }
      rows.push_back(text);
    }
    return rows;
  }
  std::vector<std::string> PlantRowsOf(const std::string& sql) const {
    PlantDatabase plant(Url());
    const PlantRows result = plant.Run(sql);
    std::vector<std::string> rows;
    for (int r = 0; r < result.size(); ++r) {
      std::string text;
      for (int c = 0; c < result.columns(); ++c) {
        const auto value = result.Text(r, c);
        text += "|" + (!value             ? "NULL"
                       : result.IsReal(c) ? Bits(std::stod(*value))
                                          : *value);
      }
      rows.push_back(text);
    }
    return rows;
  }
  static std::string Bits(double value) {
    return std::to_string(std::bit_cast<std::uint64_t>(value));
  }

  // By query on both sides: each table, and the public view.
  void ExpectEqual(const std::string& monitor) const {
    struct Pair {
      const char* table;
      const char* columns;
      const char* order;
    };
    for (const Pair& pair :
         {Pair{"episode",
               "episode_id, valve_id, source_id, detected_ns, isolated_ns, "
               "cleared_ns, ended_ns, end_reason, fault, fault_bits, "
               "peak_factor, strength, unknown_kind, layer, model_set, "
               "model_hash, flow_unit, channels, faults, known, certainty, "
               "look_alikes, return_hours, notice, label, acked_by, acked_ns, "
               "session_id",
               "episode_id"},
          {"episode_fault",
           "episode_id, fault, fault_bit, first_ns, held, detected_ns",
           "episode_id, fault"},
          {"episode_event",
           "event_id, episode_id, kind, stamp_ns, recorded_ns, faults, "
           "fault_bits, factor, strength, reason, layer, value, who, comment, "
           "origin",
           "event_id"},
          {"episode_trace",
           "episode_id, chunk, first_ns, last_ns, instants, sample_codec, "
           "sample_crc, HEX(samples), vector_crc, HEX(vectors)",
           "episode_id, chunk"},
          {"episode_look", "episode_id, first_ns, period_ns, misfit",
           "episode_id"},
          {"episode_look_fault",
           "episode_id, rank, fault, strength, lowest, highest, begins_ns, "
           "growing",
           "episode_id, rank"},
          {"episode_look_row", "episode_id, row, x_pct, flow",
           "episode_id, row"},
          {"episode_strength",
           "episode_id, stamp_ns, fault, strength, lowest, highest, layer",
           "episode_id, stamp_ns, fault"},
          {"coverage_day", "valve_id, day, quality, samples, seconds",
           "valve_id, day, quality"},
          {"health_hour",
           "valve_id, hour, model_hash, epoch, live_ms, HEX(bytes)",
           "valve_id, hour, model_hash, epoch"},
          {"data_gap", "gap_id, valve_id, from_ns, to_ns, reason, session_id",
           "gap_id"},
          {"shelf",
           "shelf_id, valve_id, fault, from_ns, until_ns, who, comment, "
           "origin, ended_ns, ended_by, ended_origin, planned_ns",
           "shelf_id"},
          {"monitor_session",
           "session_id, start_ns, alive_ns, stop_ns, clean, software",
           "session_id"},
          {"common_cause", "cause_id, group_name, opened_ns, ended_ns",
           "cause_id"},
          {"common_cause_member",
           "cause_id, episode_id, valve_id, fault, isolated_ns",
           "cause_id, episode_id"},
          {"fault_name", "fault, name, description", "fault"}}) {
      std::string there(pair.columns);
      for (std::size_t at = 0; (at = there.find("HEX(", at)) != there.npos;) {
        const std::size_t end = there.find(')', at);
        const std::string column = there.substr(at + 4, end - at - 4);
        there.replace(at, end - at + 1, "upper(encode(" + column + ", 'hex'))");
      }
      ExpectSame(pair.table,
                 SqliteRows(directory_.path() / monitor / "history.db",
                            std::string("SELECT ") + pair.columns + " FROM " +
                                pair.table + " ORDER BY " + pair.order),
                 PlantRowsOf("SELECT " + there + " FROM fdi." + pair.table +
                             " JOIN fdi.monitor m USING (monitor_id) WHERE "
                             "m.monitor = '" +
                             monitor + "' ORDER BY " + pair.order));
    }
    const auto utc = [](const std::string& column) {
      return "to_char(" + column +
             " AT TIME ZONE 'UTC', 'YYYY-MM-DD\"T\"HH24:MI:SS.MS\"Z\"')";
    };
    ExpectSame(
        "fault_history",
        SqliteRows(directory_.path() / monitor / "history.db",
                   "SELECT * FROM fault_history ORDER BY episode_id"),
        PlantRowsOf("SELECT episode_id, valve_id, " + utc("detected_utc") +
                    ", " + utc("isolated_utc") + ", " + utc("cleared_utc") +
                    ", fault, peak_factor, model_set, end_reason, "
                    "label, acked_by, strength, worst_strength, severity, "
                    "priority, " +
                    utc("unconfirmed_utc") + ", fault_name, " +
                    utc("acked_utc") + ", ack_comment, alarm_state, " +
                    utc("shelved_until_utc") + ", " + utc("ended_utc") +
                    ", certainty, look_alikes, second, description" +
                    ", return_hours FROM fdi.fault_history WHERE "
                    "monitor = '" +
                    monitor + "' ORDER BY episode_id"));
  }

  static PrivatePostgres* server_;
  std::string database_;

 private:
  static void ExpectSame(const std::string& what,
                         const std::vector<std::string>& here,
                         const std::vector<std::string>& there) {
    ASSERT_EQ(here.size(), there.size()) << what;
    for (std::size_t i = 0; i < here.size(); ++i) {
      ASSERT_EQ(here[i], there[i]) << what << ", row " << i;
    }
  }
};

inline PrivatePostgres* PlantFixture::server_ = nullptr;

}  // namespace fdi::storage
