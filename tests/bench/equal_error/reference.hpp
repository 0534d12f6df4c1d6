// What errors are measured against: a long render in two independent halves.
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

// By `method`, which traces both worlds at once. The plate, which says where the sensor clips,
// comes from its paired form with an eighth of the samples. `samples`: of both halves together.
Reference make_reference(const std::shared_ptr<render::Device>& device, const View& view,
                         const Method& method, int samples);

// The estimate composited over the reference's plate, against it.
truth::Measures error_of(const Reference& reference, truth::EstimatedFrame estimate);

}  // namespace previz::bench
