// The blur of a lens.
#pragma once

#include <span>

namespace silhouette {

// Convolves an image of `width` columns, row by row, with a Gaussian of standard deviation `sigma`
// pixels; beyond the border lies what is at the border. 0: leaves it alone.
void Blur(std::span<float> image, int width, double sigma);

}  // namespace silhouette
