// The model's part of `previzd check`: how far it is from the pictures of a take.
#pragma once

#include <iosfwd>

#include "daemon/core/fit/figure.hpp"
#include "daemon/core/pipeline/take.hpp"
#include "daemon/core/scene/scene.hpp"
#include "daemon/core/set/check.hpp"

namespace previz::check {

// Measures five frames that are spread over the take, or all of fewer; those without a pose, and
// those that cannot be read, are left out. `scene` is that of the take's set.
fit::Figure fit_of_model(const pipeline::Take& take, const scene::Scene& scene);

// Prints the figure; nothing where the set has no real object.
void describe_fit(const fit::Figure& figure, const set::Set& set, std::ostream& out);

// Remarks on a model that is off, or that the pictures do not show.
void remark_on_fit(const fit::Figure& figure, const set::Set& set, set::Findings& findings);

}  // namespace previz::check
