// What glTF's extensions are to previzd: read, ignored with a note, or refused where they are
// required.
#pragma once

#include <tiny_gltf.h>

#include <cstddef>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "daemon/core/scene/load_log.hpp"

namespace previz::scene {

// Throws previz::Error beginning with `file`, with a remedy where one is known, if the file
// requires an extension that is neither read nor ignored. One that only changes looks is ignored
// even where it is required: what stands where is right without it, and the note says what looks
// different.
void check_required_extensions(const nlohmann::json& root, const std::string& file);

// Returns whether an extension that is not read says what a material looks like in place of glTF's
// own words, so that the material is white without it.
bool replaces_materials(const std::string& extension);

// Returns the names of these materials of the file, in brackets and at most three; "" of none.
std::string in_brackets(const tinygltf::Model& model, const std::vector<std::size_t>& materials);

// Notes the extensions that the file uses, or a material without the file saying so, and previzd
// does not read.
void note_extensions(const tinygltf::Model& model, Notes& notes);

}  // namespace previz::scene
