/// Work that is left out where it changes nothing. All of it by default; each can be done after all, to see what leaving it out
/// gains: the results are the same, bit for bit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Skips {
    /// Parts of the mesh below the horizon are not searched.
    pub below_horizon: bool,
    /// Neighbours share one search.
    pub shared_searches: bool,
    /// A receiver without contours and without anything overhead sees all: no isoline is followed.
    pub open_receivers: bool,
    /// A receiver without contours but with something overhead sees nothing: no isoline is followed.
    pub enclosed_receivers: bool,
    /// Contours between two isolines are not placed on their circles.
    pub between_isolines: bool,
    /// Groups of bodies of which nothing can be seen, along the isolines or, by the exact method, at all, are not looked at, nor searched.
    pub hidden_bodies: bool,
}

impl Skips {
    /// Everything is done.
    pub const NONE: Self = Self {
        below_horizon: false,
        shared_searches: false,
        open_receivers: false,
        enclosed_receivers: false,
        between_isolines: false,
        hidden_bodies: false,
    };

    /// For each kind of work its name, and everything left out but that.
    pub fn each() -> [(&'static str, Self); 6] {
        let all = Self::default();
        [
            ("below_horizon", Self { below_horizon: false, ..all }),
            ("shared_searches", Self { shared_searches: false, ..all }),
            ("open_receivers", Self { open_receivers: false, ..all }),
            ("enclosed_receivers", Self { enclosed_receivers: false, ..all }),
            ("between_isolines", Self { between_isolines: false, ..all }),
            ("hidden_bodies", Self { hidden_bodies: false, ..all }),
        ]
    }
}

impl Default for Skips {
    fn default() -> Self {
        Self {
            below_horizon: true,
            shared_searches: true,
            open_receivers: true,
            enclosed_receivers: true,
            between_isolines: true,
            hidden_bodies: true,
        }
    }
}
