#include "tests/bench/equal_error/reference.hpp"

#include <algorithm>

namespace previz::bench {
namespace {

// Apart from those of the methods measured, which count up from 1.
constexpr std::uint32_t first_seed = 1'000'000;

truth::EstimatedFrame rendered(MethodRun& run, std::uint32_t seed, int samples) {
  run.begin(seed);
  run.render(samples);
  return run.estimate();
}

template <class T>
render::Sheet<T> middle(const render::Sheet<T>& a, const render::Sheet<T>& b) {
  render::Sheet<T> result;
  for (std::size_t i = 0; i < a.size(); ++i) result.push_back(0.5f * (a[i] + b[i]));
  return result;
}

}  // namespace

Reference reference_of(truth::TruthFrame frame, const truth::EstimatedFrame& a,
                       const truth::EstimatedFrame& b) {
  Reference reference{std::move(frame), {}};
  truth::TruthFrame& r = reference.frame;
  const render::Sheet<glm::vec3> diff = middle(a.diff, b.diff);
  r.mask = middle(a.mask, b.mask);
  r.mixed = middle(a.mixed, b.mixed);
  r.real = r.plate;
  for (std::size_t i = 0; i < diff.size(); ++i)
    if (r.mask[i] == 0) r.mixed[i] = r.real[i] + diff[i];
  // A half is as far from the mean as the mean, in expectation, from what both estimate.
  reference.noise = error_of(reference, a);
  return reference;
}

Reference make_reference(const std::shared_ptr<render::Device>& device, const View& view,
                         const Method& method, int samples) {
  Method paired = method;
  paired.estimation.estimator = set::Estimator::paired;
  MethodRun both(device, view, paired);
  truth::TruthFrame frame;
  frame.width = view.camera.intrinsics.width;
  frame.height = view.camera.intrinsics.height;
  frame.exposure = view.exposure;
  frame.response = view.camera.response;
  frame.plate = rendered(both, first_seed, std::max(samples / 8, 1)).real;
  MethodRun run(device, view, method);
  const truth::EstimatedFrame half = rendered(run, first_seed + 1, samples / 2);
  return reference_of(std::move(frame), half, rendered(run, first_seed + 2, samples / 2));
}

truth::Measures error_of(const Reference& reference, truth::EstimatedFrame estimate) {
  return truth::compare(reference.frame, truth::composited(reference.frame, std::move(estimate)));
}

}  // namespace previz::bench
