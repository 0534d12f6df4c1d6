// Owns Aravis' GObjects and puts their errors into words. A target that includes this header must
// link Aravis.
#pragma once

#include <arv.h>

#include <memory>
#include <string>

#include "drivers/error.hpp"

namespace previz::aravis {

struct Unref {
  void operator()(gpointer object) const { g_object_unref(object); }
};
template <typename Type>
using Owned = std::unique_ptr<Type, Unref>;

struct Free {
  void operator()(gpointer memory) const { g_free(memory); }
};
template <typename Type>
using OwnedArray = std::unique_ptr<Type[], Free>;

// Holds the error of a failed call; out() is passed as the call's GError**.
class Failure {
 public:
  Failure() = default;
  ~Failure() { g_clear_error(&error_); }
  Failure(const Failure&) = delete;
  Failure& operator=(const Failure&) = delete;

  GError** out() {
    g_clear_error(&error_);
    return &error_;
  }
  bool failed() const { return error_ != nullptr; }
  std::string text() const { return error_ ? error_->message : "no reason is given"; }

  // Throws previz::Error "<device>: <what>: <Aravis' reason>" if the last call failed.
  void check(const std::string& device, const std::string& what) const {
    if (error_) throw Error(device + ": " + what + ": " + text());
  }

 private:
  GError* error_ = nullptr;
};

}  // namespace previz::aravis
