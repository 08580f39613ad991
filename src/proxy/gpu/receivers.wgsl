// What all passes over receivers share.

struct View {
    // Receivers across and down, and their number: place y * width + x. All is in bands of rows where a device holds no more.
    width: u32,
    height: u32,
    count: u32,
    proxies: u32,
    // Pixels of the display in this band, and how many of them a receiver stands for across and down.
    fine_width: u32,
    fine_height: u32,
    scale: u32,
    // Side of a pixel of the display at depth 1.
    pixel: f32,
    // Reach over radius, for shadows and for indirect light.
    shadow_expansion: f32,
    indirect_expansion: f32,
    // Whether there is indirect light.
    reflects: u32,
    // Where the band begins among the rows of all receivers, and of the display.
    first_row: u32,
    fine_first_row: u32,
    padding0: u32,
    padding1: u32,
    padding2: u32,
}

struct Receiver {
    position: vec3f,
    // Distance along the view; beyond NOTHING nothing is seen.
    depth: f32,
    normal: vec3f,
    padding: f32,
    albedo: vec3f,
    padding2: f32,
}

struct Proxy {
    center: vec3f,
    radius: f32,
    albedo: vec3f,
    // How much of what it hides it counts for.
    share: f32,
}

const NOTHING: f32 = 1e37;
// sqrt(4 pi): the constant 1 in spherical harmonics.
const ONE: f32 = 3.5449077;
const MIN_POSITIVE: f32 = 1.17549435e-38;
// Fills up the last row of pixels that are shaded anew.
const NO_PIXEL: u32 = 0xffffffffu;
