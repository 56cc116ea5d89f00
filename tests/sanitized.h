#pragma once

namespace fdi {

/// True if the address or the thread sanitizer watches: without memory it ends
/// the process itself, without descriptors it takes sound objects for broken.
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
inline constexpr bool kSanitized = true;
#elif defined(__has_feature)
inline constexpr bool kSanitized =
    __has_feature(address_sanitizer) || __has_feature(thread_sanitizer);
#else
inline constexpr bool kSanitized = false;
#endif

}  // namespace fdi
