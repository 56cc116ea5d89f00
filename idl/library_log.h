#pragma once

#include "diagnosis/log.h"

namespace fdi::idl {

/// While it lives, what the DDS library logs goes to `sink`, at most one line
/// per place in the library and 10 s; with several alive, to the newest. The
/// library never writes to stdout once one has existed.
class LibraryLog {
 public:
  explicit LibraryLog(LogSink sink);
  ~LibraryLog();
  LibraryLog(const LibraryLog&) = delete;
  LibraryLog& operator=(const LibraryLog&) = delete;

 private:
  LogSink sink_;
};

}  // namespace fdi::idl
