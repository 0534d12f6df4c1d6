// The reference for errors: a long render in two independent halves.
#pragma once

#include "tests/bench/equal_error/method.hpp"

namespace previz::bench {

struct Reference {
  truth::TruthFrame frame;  // the plate is its real world's own radiance
  truth::Measures noise;    // of the mean of the halves: half their difference
};

// The mean of two halves over the plate of `frame`.
Reference reference_of(truth::TruthFrame frame, const truth::EstimatedFrame& a,
                       const truth::EstimatedFrame& b);

// Renders the reference by `method`, which traces both worlds at once. The plate, which decides
// where the sensor clips, comes from the method's paired form with an eighth of the samples.
// `samples` counts both halves together.
Reference make_reference(const std::shared_ptr<render::Device>& device, const View& view,
                         const Method& method, int samples);

// Composites the estimate over the reference's plate and returns its errors against the reference.
truth::Measures error_of(const Reference& reference, truth::EstimatedFrame estimate);

}  // namespace previz::bench
