// SPDX-License-Identifier: Apache-2.0
#pragma once

// Before a function: it is compiled for every x86-64 processor, once more for those with AVX2 and
// fused arithmetic (x86-64-v3) and once more for those with AVX-512 (x86-64-v4); which of them is
// called is decided when the program is loaded. Nothing before functions of other processors, nor
// with clang, which takes it before declarations only, nor with a sanitizer: the decision would be
// made before the sanitizer is ready.
#if defined(__x86_64__) && !defined(__clang__) && !defined(__SANITIZE_ADDRESS__) && \
    !defined(__SANITIZE_THREAD__)
#define SILHOUETTE_WIDER_VECTORS \
  [[gnu::target_clones("arch=x86-64-v4", "arch=x86-64-v3", "default")]]
#else
#define SILHOUETTE_WIDER_VECTORS
#endif
