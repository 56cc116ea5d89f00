#pragma once

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <memory>
#include <stdexcept>
#include <string>

#include <pwd.h>
#include <signal.h>
#include <unistd.h>

#include "tests/storage/temporary_directory.h"

namespace fdi::storage {

/// A PostgreSQL server of our own on a Unix socket in a temporary folder, with
/// the superuser `postgres`; as that user of the system where the test is root,
/// whom PostgreSQL refuses.
class PrivatePostgres {
 public:
  /// Debian's package postgresql is installed.
  static bool IsInstalled() { return !NewestBin().empty(); }

  PrivatePostgres() {
    if (geteuid() == 0) {
      const passwd* user = getpwnam("postgres");
      if (user == nullptr ||
          chown(directory_.path().c_str(), user->pw_uid, user->pw_gid) != 0) {
        throw std::runtime_error("no user postgres");
      }
      as_user_ = "setpriv --reuid=postgres --regid=postgres --clear-groups ";
    }
    Must(bin_ + "initdb -D " + data() +
         " -U postgres -A trust -E UTF8 --locale=C.UTF-8 --no-sync");
    // No test cuts the power, and after a crash the server would sync all files
    // of all databases before it starts.
    std::ofstream(data() + "/postgresql.conf", std::ios::app)
        << "listen_addresses = ''\nfsync = off\nunix_socket_directories = '"
        << folder() << "'\n";
    Start();
  }
  ~PrivatePostgres() {
    Run(bin_ + "pg_ctl -D " + data() + " -m immediate stop");
  }

  /// Tried again while children of a killed server are still there.
  void Start() {
    const std::string start =
        bin_ + "pg_ctl -D " + data() + " -w -l " + folder() + "/log start";
    for (int i = 0; i < 100 && Run(start) != 0; ++i) {
      usleep(100'000);
    }
    Must(bin_ + "pg_isready -q -h " + folder());
  }
  void Stop() { Must(bin_ + "pg_ctl -D " + data() + " -m fast -w stop"); }
  /// kill -9 of the server.
  void Crash() { kill(Pid(), SIGKILL); }
  pid_t Pid() const {
    pid_t pid = 0;
    std::ifstream(data() + "/postmaster.pid") >> pid;
    return pid;
  }
  /// A database of its own; as `user`.
  void Create(const std::string& database) {
    Must(bin_ + "createdb -h " + folder() + " -U postgres " + database);
  }
  std::string Url(const std::string& database,
                  const std::string& user = "postgres") const {
    return "postgresql://" + user + "@/" + database + "?host=" + folder();
  }
  std::string folder() const { return directory_.path().string(); }
  std::string data() const { return folder() + "/cluster"; }

 private:
  static std::string NewestBin() {
    const std::filesystem::path root = "/usr/lib/postgresql";
    int newest = 0;
    if (std::filesystem::exists(root)) {
      for (const auto& entry : std::filesystem::directory_iterator(root)) {
        if (std::filesystem::exists(entry.path() / "bin/initdb")) {
          newest = std::max(newest, std::atoi(entry.path().filename().c_str()));
        }
      }
    }
    return newest == 0 ? std::string()
                       : root.string() + "/" + std::to_string(newest) + "/bin/";
  }
  int Run(const std::string& command) const {
    return std::system(("cd / && " + as_user_ + command + " >>" + folder() +
                        "/commands 2>&1 </dev/null")
                           .c_str());
  }
  void Must(const std::string& command) const {
    if (Run(command) != 0) {
      throw std::runtime_error("failed: " + command);
    }
  }

  TemporaryDirectory directory_;
  std::string bin_{NewestBin()};
  std::string as_user_;
};

}  // namespace fdi::storage
