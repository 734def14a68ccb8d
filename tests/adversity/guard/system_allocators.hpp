#pragma once

#include <cstddef>

/// The replacements of malloc() and the others call these, by the names that glibc gives them.
extern "C" {
void* __libc_malloc(std::size_t) noexcept;
void* __libc_calloc(std::size_t, std::size_t) noexcept;
void* __libc_realloc(void*, std::size_t) noexcept;
void* __libc_memalign(std::size_t, std::size_t) noexcept;
void __libc_free(void*) noexcept;
}

#define EXPORT extern "C" __attribute__((visibility("default")))
