#pragma once

#include <stdexcept>
#include <string>

#include <fcntl.h>
#include <sys/file.h>
#include <unistd.h>

#include "idl/participant.h"

namespace fdi::idl {

/// A domain id in 60..99 that no other test process has, as long as it lives.
/// From 102 on the ports of a domain (7400 + 250 id) are ephemeral ones, which
/// any socket may hold.
class TestDomain {
 public:
  TestDomain() {
    for (int i = 0; i < 40; ++i) {
      id_ = 60 + (getpid() + i) % 40;
      const std::string path =
          "/tmp/fdi-test-domain-" + std::to_string(id_) + ".lock";
      // The file may be another user's, which nobody else can write, and which
      // the kernel does not open with O_CREAT in a folder that all share.
      file_ = open(path.c_str(), O_RDONLY | O_CLOEXEC);
      if (file_ < 0) {
        file_ = open(path.c_str(), O_CREAT | O_RDONLY | O_CLOEXEC, 0644);
      }
      if (file_ >= 0 && flock(file_, LOCK_EX | LOCK_NB) == 0) {
        return;
      }
      close(file_);
    }
    throw std::runtime_error("no free test domain");
  }
  ~TestDomain() { close(file_); }
  TestDomain(const TestDomain&) = delete;
  TestDomain& operator=(const TestDomain&) = delete;

  int id() const { return id_; }
  DdsOptions Options() const {
    DdsOptions options;
    options.domain = id_;
    return options;
  }

 private:
  int id_{0};
  int file_{-1};
};

}  // namespace fdi::idl
