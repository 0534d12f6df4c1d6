#include "drivers/kms/kms_display.hpp"

#include <poll.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cstring>
#include <optional>
#include <span>
#include <string>
#include <utility>

#include "drivers/error.hpp"
#include "drivers/gles/painter.hpp"
#include "drivers/kms/cards.hpp"
#include "drivers/kms/hotplug.hpp"
#include "drivers/kms/modes.hpp"
#include "drivers/kms/output.hpp"
#include "drivers/kms/scanout.hpp"

namespace previz {
namespace {

using namespace kms;

// A screen of 24 Hz flips every 42 ms; setting a mode can take the card half a second.
constexpr std::chrono::milliseconds flip_timeout{2000};

std::span<const drmModeModeInfo> modes_of(const drmModeConnector& connector) {
  return {connector.modes, static_cast<std::size_t>(connector.count_modes)};
}

bool has_screen(const drmModeConnector& connector) {
  return connector.connection == DRM_MODE_CONNECTED && connector.count_modes > 0;
}

struct Target {
  Card card;
  OwnedDescriptor descriptor;
  DrmOwned<drmModeConnector> connector;
};

// Returns the connector that is meant, or the first with a screen.
Target find_target(const std::string& wanted) {
  std::string seen, refusal;
  for (const Card& card : find_cards()) {
    OwnedDescriptor descriptor;
    try {
      descriptor = open_card(card);
    } catch (const Error& error) {
      refusal = std::string("; ") + error.what();
      continue;
    }
    for (DrmOwned<drmModeConnector>& connector : connectors_of(descriptor.get())) {
      const std::string name = name_of(*connector);
      const bool meant = wanted.empty() || is_meant(wanted, card, *connector);
      if (meant && has_screen(*connector))
        return {card, std::move(descriptor), std::move(connector)};
      if (meant && !wanted.empty()) throw Error(name + ": no screen is plugged in");
      add_to_list(seen, name);
    }
  }
  if (wanted.empty())
    throw Error(
        "no screen is plugged in" +
        (seen.empty() ? std::string("; no graphics card could drive one") : " (" + seen + ")") +
        refusal);
  throw Error("no connector " + wanted + "; there is " + (seen.empty() ? "none" : seen) + refusal);
}

bool become_master(int card) {
  return drmSetMaster(card) == 0 || drmIsMaster(card) != 0;
}

class KmsDisplay final : public Display {
 public:
  KmsDisplay(Target target, const DisplaySettings& settings);
  ~KmsDisplay() override;

  std::string name() const override { return name_of(*target_.connector); }
  DisplayMode mode() const override { return mode_of(mode_); }
  DisplayEvent show(const Screenful& screenful) override;
  std::optional<CardIdentity> card() const override { return painter_.card(); }
  void release() override;
  Plate read_back() override;

 private:
  DeviceTrouble lost(const std::string& why) const { return {name(), why, true}; }
  std::optional<DeviceTrouble> look_at_plug();
  std::optional<std::int64_t> wait_for_flip();
  static int checked_master(int card, const Card& where);

  Target target_;
  const int card_;
  const drmModeModeInfo mode_;
  Hotplug hotplug_;
  Output output_;
  Scanout scanout_;
  gles::Painter painter_;
  bool master_ = true;
  std::optional<std::int64_t> flipped_ns_;  // time in the card's event for the flip under way
};

int KmsDisplay::checked_master(int card, const Card& where) {
  if (!become_master(card))
    throw Error(where.node + ": another program is using the screen (a window system?)");
  return card;
}

KmsDisplay::KmsDisplay(Target target, const DisplaySettings& settings)
    : target_(std::move(target)),
      card_(checked_master(target_.descriptor.get(), target_.card)),
      mode_(choose_mode(modes_of(*target_.connector), settings.mode)),
      output_(card_, *target_.connector, mode_),
      scanout_(card_, mode_.hdisplay, mode_.vdisplay),
      painter_(mode_.hdisplay, mode_.vdisplay, settings.scale) {}

KmsDisplay::~KmsDisplay() {
  try {
    scanout_.begin();
  } catch (const Error&) {
    // After a reset of the GPU the painter's objects are gone with its context, but the screen is
    // not.
  }
  if (!master_) return;
  output_.restore();
  drmDropMaster(card_);
}

DisplayEvent KmsDisplay::show(const Screenful& screenful) {
  if (std::optional<DeviceTrouble> unplugged = look_at_plug()) return *std::move(unplugged);
  if (!master_) {
    if (!become_master(card_))
      return DeviceTrouble{name(), "another program is using the screen", false};
    master_ = true;
  }
  scanout_.begin();
  std::optional<std::string> refused = painter_.take(screenful);
  painter_.draw();
  const std::uint32_t framebuffer = scanout_.finish();
  flipped_ns_.reset();
  if (const int error = output_.flip(framebuffer, &flipped_ns_)) {
    scanout_.withdraw();
    gles::Painter::finish();  // the caller may let go of a card's picture
    if (error != EACCES)
      return lost(std::string("cannot display a picture: ") + std::strerror(error));
    master_ = false;
    return DeviceTrouble{name(), "another program is using the screen", false};
  }
  const std::optional<std::int64_t> shown_ns = wait_for_flip();
  if (!shown_ns) return lost("shows nothing: the graphics card does not respond");
  scanout_.seen();
  if (refused) return DeviceTrouble{name(), *std::move(refused), false};  // the overlay is shown
  return Shown{*shown_ns};
}

Plate KmsDisplay::read_back() {
  scanout_.begin();
  return painter_.read_back();
}

void KmsDisplay::release() {
  if (!std::exchange(master_, false)) return;
  output_.dark();
  drmDropMaster(card_);
}

std::optional<DeviceTrouble> KmsDisplay::look_at_plug() {
  if (!hotplug_.happened()) return std::nullopt;
  const DrmOwned<drmModeConnector> now(drmModeGetConnector(card_, target_.connector->connector_id));
  if (!now || !has_screen(*now)) return lost("the screen was unplugged");
  const auto same = [this](const drmModeModeInfo& info) {
    return std::memcmp(&info, &mode_, sizeof info) == 0;
  };
  if (std::ranges::none_of(modes_of(*now), same)) return lost("another screen was plugged in");
  return std::nullopt;
}

// Returns the time of the vertical blank, which the kernel gives on CLOCK_MONOTONIC.
std::optional<std::int64_t> KmsDisplay::wait_for_flip() {
  drmEventContext handler{};
  handler.version = 3;
  handler.page_flip_handler2 = [](int, unsigned, unsigned seconds, unsigned microseconds, unsigned,
                                  void* flipped_ns) {
    *static_cast<std::optional<std::int64_t>*>(flipped_ns) =
        std::int64_t{seconds} * 1'000'000'000 + std::int64_t{microseconds} * 1000;
  };
  const auto deadline = std::chrono::steady_clock::now() + flip_timeout;
  while (!flipped_ns_) {
    const auto left =
        std::chrono::ceil<std::chrono::milliseconds>(deadline - std::chrono::steady_clock::now());
    if (left.count() <= 0) return std::nullopt;
    pollfd waiting{card_, POLLIN, 0};
    if (poll(&waiting, 1, static_cast<int>(left.count())) > 0) drmHandleEvent(card_, &handler);
  }
  return flipped_ns_;
}

}  // namespace

std::unique_ptr<Display> open_kms(const DisplaySettings& settings) {
  Target target = find_target(settings.connector);
  const std::string name = name_of(*target.connector);
  try {
    return std::make_unique<KmsDisplay>(std::move(target), settings);
  } catch (const Error& error) {
    throw Error(name + ": " + error.what());
  }
}

std::vector<FoundDisplay> find_kms() {
  struct Seen {
    Card card;
    std::string name, description;
  };
  std::vector<Seen> seen;
  for (const Card& card : find_cards()) {
    try {
      const OwnedDescriptor descriptor = open_card(card);
      for (const DrmOwned<drmModeConnector>& connector : connectors_of(descriptor.get()))
        seen.push_back(
            {card, name_of(*connector),
             has_screen(*connector) ? list_of(modes_of(*connector)) : "no screen is plugged in"});
    } catch (const Error& error) {
      seen.push_back({card, card.node, error.what()});
    }
  }
  std::vector<FoundDisplay> found;
  for (const Seen& one : seen) {
    const auto namesakes = std::ranges::count(seen, one.name, &Seen::name);
    found.push_back({namesakes > 1 ? one.card.bus + "/" + one.name : one.name, one.description});
  }
  return found;
}

}  // namespace previz
