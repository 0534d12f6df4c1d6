// Writes the results of `previz trade` as a table for programs and as a page for people.
#pragma once

#include <string>

#include "daemon/tools/trade/report.hpp"

namespace previz::trade {

// Returns a CSV line for every number of samples of every variant of every axis; the first line,
// with axis "reference", is the reference's own error. The columns are:
//   axis, variant, samples
//   seconds                          of rendering
//   e_diff, e_virtual, e_picture     TradeErrors, as shares; empty: no such pixels
//   reference_noise                  the reference's own e_picture
//   pareto                           1: on the front of seconds and e_picture
//   within_noise                     errors for which the reference is too noisy
//   bias                             of the variant (TradeReference::Bias); empty: not known
std::string trade_csv(const TradeReport& report);

// Returns one HTML file that needs no other files.
std::string trade_page(const TradeReport& report);

// Returns "3.2 s: estimator difference, 16 samples, error 4 %".
std::string front_words(const TradeReport& report, const TradeFrontPoint& at);

}  // namespace previz::trade
