// Linked into programs of the sanitizer build, for LeakSanitizer's sake: Mesa's lavapipe leaves a
// hundred bytes a device behind. The report could not tell whose they are, since the Vulkan loader
// has unloaded the driver by then; so libraries stay loaded, and the driver's leaks can be named.

extern "C" {

const char* __lsan_default_suppressions() {
  return "leak:libvulkan_lvp.so\n";
}

int dlclose(void* /*library*/) {
  return 0;
}

}  // extern "C"
