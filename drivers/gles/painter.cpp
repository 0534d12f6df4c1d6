#include "drivers/gles/painter.hpp"

#include <algorithm>
#include <string>

#include "drivers/error.hpp"
#include "drivers/gles/placement.hpp"

namespace previz::gles {
namespace {

// The uniform is a rectangle of the screen in clip coordinates: left, top, width, height
// (downwards).
constexpr const char* vertex_source = R"(#version 300 es
uniform vec4 rectangle;
out vec2 texture_point;
void main() {
  vec2 corner = vec2(gl_VertexID & 1, gl_VertexID >> 1);
  texture_point = corner;
  gl_Position = vec4(rectangle.x + corner.x * rectangle.z, rectangle.y - corner.y * rectangle.w, 0, 1);
}
)";
constexpr const char* fragment_source = R"(#version 300 es
precision highp float;
uniform sampler2D picture;
in vec2 texture_point;
out vec4 colour;
void main() { colour = texture(picture, texture_point); }
)";

void check(const char* what) {
  const GLenum error = glGetError();
  if (error == GL_NO_ERROR) return;
  throw Error(std::string("OpenGL ES: ") + what + ": " +
              (error == GL_OUT_OF_MEMORY ? "out of memory" : "error " + std::to_string(error)));
}

GLuint compile(GLenum stage, const char* source) {
  const GLuint shader = glCreateShader(stage);
  glShaderSource(shader, 1, &source, nullptr);
  glCompileShader(shader);
  return shader;
}

GLuint link() {
  const GLuint program = glCreateProgram();
  for (const GLuint shader :
       {compile(GL_VERTEX_SHADER, vertex_source), compile(GL_FRAGMENT_SHADER, fragment_source)}) {
    glAttachShader(program, shader);
    glDeleteShader(shader);  // it is freed with the program
  }
  glLinkProgram(program);
  GLint linked = GL_FALSE;
  glGetProgramiv(program, GL_LINK_STATUS, &linked);
  if (linked == GL_TRUE) return program;
  char why[512] = "";
  glGetProgramInfoLog(program, sizeof why, nullptr, why);
  glDeleteProgram(program);
  throw Error(std::string("OpenGL ES: the display's shaders do not link: ") + why);
}

GLuint new_texture(GLint minify, GLint magnify) {
  GLuint name = 0;
  glGenTextures(1, &name);
  glBindTexture(GL_TEXTURE_2D, name);
  glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MIN_FILTER, minify);
  glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MAG_FILTER, magnify);
  glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_WRAP_S, GL_CLAMP_TO_EDGE);
  glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_WRAP_T, GL_CLAMP_TO_EDGE);
  return name;
}

void check_fits(int width, int height) {
  GLint most = 0;
  glGetIntegerv(GL_MAX_TEXTURE_SIZE, &most);
  if (std::max(width, height) > most)
    throw Error("OpenGL ES: a picture of " + std::to_string(width) + "x" + std::to_string(height) +
                " is larger than this GPU's " + std::to_string(most) + " pixels per side");
}

// Converts to 8 bits a sample, rounded to nearest.
void to_bytes(const Plate& picture, std::vector<std::uint8_t>& bytes) {
  bytes.resize(picture.samples.size());
  const auto narrow = [deep = picture.bits == 16](std::uint16_t sample) {
    return static_cast<std::uint8_t>(deep ? (sample * 255u + 32767u) / 65535u : sample);
  };
  std::ranges::transform(picture.samples, bytes.begin(), narrow);
}

// Binds a framebuffer of its own to draw into, for as long as the object lives.
class Offscreen {
 public:
  Offscreen(int width, int height) {
    glGetIntegerv(GL_FRAMEBUFFER_BINDING, &before_);
    glGenFramebuffers(1, &framebuffer_);
    glGenRenderbuffers(1, &colour_);
    glBindFramebuffer(GL_FRAMEBUFFER, framebuffer_);
    glBindRenderbuffer(GL_RENDERBUFFER, colour_);
    glRenderbufferStorage(GL_RENDERBUFFER, GL_RGBA8, width, height);
    glFramebufferRenderbuffer(GL_FRAMEBUFFER, GL_COLOR_ATTACHMENT0, GL_RENDERBUFFER, colour_);
  }
  ~Offscreen() {
    glBindFramebuffer(GL_FRAMEBUFFER, static_cast<GLuint>(before_));
    glDeleteRenderbuffers(1, &colour_);
    glDeleteFramebuffers(1, &framebuffer_);
  }
  Offscreen(const Offscreen&) = delete;
  Offscreen& operator=(const Offscreen&) = delete;

 private:
  GLint before_ = 0;
  GLuint framebuffer_ = 0, colour_ = 0;
};

}  // namespace

Painter::Painter(int screen_width, int screen_height, DisplayScale scale)
    : width_(screen_width), height_(screen_height), scale_(scale), program_(link()) {
  rectangle_ = glGetUniformLocation(program_, "rectangle");
  glGenVertexArrays(1, &vertices_);
  glPixelStorei(GL_UNPACK_ALIGNMENT, 1);
  glPixelStorei(GL_PACK_ALIGNMENT, 1);
  glDisable(GL_DITHER);
  check("the display cannot be drawn");
}

Painter::~Painter() {
  forget_overlays();
  forget_picture();
  glDeleteVertexArrays(1, &vertices_);
  glDeleteProgram(program_);
}

std::optional<std::string> Painter::take(const Screenful& screenful) {
  const bool is_on_card = screenful.on_card && copy(*screenful.on_card);
  if (!is_on_card) take(screenful.picture);
  upload(screenful.overlays);
  if (!screenful.on_card || is_on_card) return std::nullopt;
  return "OpenGL ES cannot show a picture that is in another graphics card's memory, or that the "
         "driver does not share; it has to come down to the computer";
}

void Painter::take(const std::shared_ptr<const Plate>& picture) {
  copied_ = 0;
  if (!picture) {
    forget_picture();
  } else if (picture != uploaded_) {
    upload(*picture);
    uploaded_ = picture;
  }
}

// Returns false, and has no picture, if OpenGL ES refuses.
bool Painter::copy(const CardPicture& picture) {
  if (picture.number == copied_) return true;
  make_picture(picture.memory->width, picture.memory->height);
  uploaded_.reset();
  copied_ = 0;
  if (!shared_.copy(picture)) {
    forget_picture();
    return false;
  }
  copied_ = picture.number;
  filter_picture();
  return true;
}

Plate Painter::read_back() {
  const Offscreen offscreen(width_, height_);
  draw();
  const std::size_t width = static_cast<std::size_t>(width_);
  std::vector<std::uint8_t> rgba(4 * width * static_cast<std::size_t>(height_));
  glReadPixels(0, 0, width_, height_, GL_RGBA, GL_UNSIGNED_BYTE, rgba.data());
  check("the screen cannot be read back");
  Plate plate{width_, height_, 8, {}};
  plate.samples.reserve(3 * rgba.size() / 4);
  for (int y = height_ - 1; y >= 0; --y)  // OpenGL's rows go upwards
    for (std::size_t x = 0; x < width; ++x)
      for (std::size_t channel = 0; channel < 3; ++channel)
        plate.samples.push_back(rgba[4 * (static_cast<std::size_t>(y) * width + x) + channel]);
  return plate;
}

void Painter::draw() {
  glViewport(0, 0, width_, height_);
  glClearColor(0, 0, 0, 1);
  glClear(GL_COLOR_BUFFER_BIT);
  glUseProgram(program_);
  glBindVertexArray(vertices_);
  if (picture_.name != 0) {
    const Rectangle at = place(picture_.width, picture_.height, width_, height_, scale_);
    draw(picture_, at.x, at.y, at.width, at.height, false);
  }
  for (const Quad& overlay : overlays_)
    draw(overlay.texture, overlay.x, overlay.y, overlay.texture.width, overlay.texture.height,
         true);
  check("the picture cannot be drawn");
}

void Painter::draw(const Texture& texture, int x, int y, int width, int height, bool blend) {
  if (blend) {
    glEnable(GL_BLEND);
    glBlendFunc(GL_ONE, GL_ONE_MINUS_SRC_ALPHA);
  } else {
    glDisable(GL_BLEND);
  }
  glBindTexture(GL_TEXTURE_2D, texture.name);
  const auto share = [](int pixels, int of) {
    return 2.0f * static_cast<float>(pixels) / static_cast<float>(of);
  };
  glUniform4f(rectangle_, share(x, width_) - 1, 1 - share(y, height_), share(width, width_),
              share(height, height_));
  glDrawArrays(GL_TRIANGLE_STRIP, 0, 4);
}

// Binds the picture's texture, which has this size from now on.
void Painter::make_picture(int width, int height) {
  const bool same_size = picture_.width == width && picture_.height == height;
  if (picture_.name != 0 && same_size) return glBindTexture(GL_TEXTURE_2D, picture_.name);
  check_fits(width, height);
  forget_picture();
  picture_ = {new_texture(GL_LINEAR_MIPMAP_NEAREST, GL_LINEAR), width, height};
  glTexImage2D(GL_TEXTURE_2D, 0, GL_RGB8, width, height, 0, GL_RGB, GL_UNSIGNED_BYTE, nullptr);
  check("the picture has no room");
}

void Painter::upload(const Plate& picture) {
  to_bytes(picture, bytes_);
  make_picture(picture.width, picture.height);
  glTexSubImage2D(GL_TEXTURE_2D, 0, 0, 0, picture_.width, picture_.height, GL_RGB, GL_UNSIGNED_BYTE,
                  bytes_.data());
  filter_picture();
}

// At a picture's own size texels fall on pixels, and both filters give the texel itself. A picture
// shown smaller than about two thirds is sampled from its mipmaps, so that it does not alias.
void Painter::filter_picture() {
  if (scale_ == DisplayScale::letterbox) {
    glGenerateMipmap(GL_TEXTURE_2D);
  } else {
    glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MIN_FILTER, GL_LINEAR);
  }
  check("the picture cannot be uploaded");
}

void Painter::upload(const std::vector<Overlay>& overlays) {
  forget_overlays();
  for (const Overlay& overlay : overlays) {
    check_fits(overlay.width, overlay.height);
    const GLuint name = new_texture(GL_NEAREST, GL_NEAREST);
    overlays_.push_back({{name, overlay.width, overlay.height}, overlay.x, overlay.y});
    glTexImage2D(GL_TEXTURE_2D, 0, GL_RGBA8, overlay.width, overlay.height, 0, GL_RGBA,
                 GL_UNSIGNED_BYTE, overlay.rgba.data());
  }
  check("the overlay cannot be uploaded");
}

void Painter::forget_picture() {
  glDeleteTextures(1, &picture_.name);
  picture_ = {};
  uploaded_.reset();
}

void Painter::forget_overlays() {
  for (const Quad& overlay : overlays_) glDeleteTextures(1, &overlay.texture.name);
  overlays_.clear();
}

}  // namespace previz::gles
