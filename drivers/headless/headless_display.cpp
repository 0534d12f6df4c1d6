#include "drivers/headless/headless_display.hpp"

#include "drivers/gles/context.hpp"
#include "drivers/gles/painter.hpp"
#include "drivers/host_clock.hpp"

namespace previz {
namespace {

constexpr DisplayMode default_mode{1280, 720, 0};

class HeadlessDisplay final : public Display {
 public:
  explicit HeadlessDisplay(const DisplaySettings& settings)
      : mode_(settings.mode.value_or(default_mode)),
        context_(EGL_PLATFORM_SURFACELESS_MESA, EGL_DEFAULT_DISPLAY),
        painter_(mode_.width, mode_.height, settings.scale) {}

  std::string name() const override { return "headless"; }
  DisplayMode mode() const override { return mode_; }
  DisplayEvent show(const Screenful& screenful) override;
  std::optional<CardIdentity> card() const override { return painter_.card(); }
  void release() override { painter_.forget(); }
  Plate read_back() override { return painter_.read_back(); }

 private:
  const DisplayMode mode_;
  gles::Context context_;
  gles::Painter painter_;
};

DisplayEvent HeadlessDisplay::show(const Screenful& screenful) {
  std::optional<std::string> refused = painter_.take(screenful);
  gles::Painter::finish();  // nothing draws it
  if (refused) return DeviceTrouble{name(), *std::move(refused), false};
  return Shown{monotonic_ns()};
}

}  // namespace

std::unique_ptr<Display> open_headless(const DisplaySettings& settings) {
  return std::make_unique<HeadlessDisplay>(settings);
}

// A headless display is always there, and has no connector.
std::vector<FoundDisplay> find_headless() {
  return {};
}

}  // namespace previz
