#include "daemon/pipeline/light_record.hpp"

#include <utility>

#include "daemon/lighting/sources.hpp"

namespace previz::pipeline {

session::CapturedLight to_record(const lighting::Lighting& lighting) {
  session::CapturedLight record;
  for (const lighting::Source& source : lighting.sources)
    record.sources.push_back({source.id, source.direction, source.solid_angle_sr, source.flux});
  lighting::EnvironmentMap ambient = lighting::blurred(lighting.environment);
  record.ambient_size = ambient.size;
  record.ambient = std::move(ambient.radiance);
  return record;
}

lighting::Lighting from_record(const session::CapturedLight& record) {
  lighting::Lighting lighting;
  for (const session::CapturedSource& source : record.sources)
    lighting.sources.push_back({source.id, source.direction, source.solid_angle_sr, source.flux});
  lighting.environment = {record.ambient_size, record.ambient};
  return lighting;
}

}  // namespace previz::pipeline
