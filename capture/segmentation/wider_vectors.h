// For functions with plain loops that the compiler makes vectors of.
#pragma once

// The function is there for every x86-64 processor and once more for those with AVX2; which of them
// is called is decided when the program is loaded. Both give the same results: there are no fused
// multiplications. Sanitizers have the first only: the decision is made before they are ready.
#if defined(__x86_64__) && !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
#define SILHOUETTE_WIDER_VECTORS [[gnu::target_clones("avx2", "default")]]
#else
#define SILHOUETTE_WIDER_VECTORS
#endif
