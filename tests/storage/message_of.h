#pragma once

#include <string>

namespace fdi::storage {

/// Message of the Error that `call` throws.
template <typename Error, typename Call>
std::string MessageOf(Call&& call) {
  try {
    call();
  } catch (const Error& error) {
    return error.what();
  }
  return "not thrown";
}

}  // namespace fdi::storage
