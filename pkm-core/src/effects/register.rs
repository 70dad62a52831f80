//! What follows from the list of effects at the end of `mod.rs`: their numbers, and a switch over them for each hook.

macro_rules! effects {
    ($($module:ident :: { $($name:ident),+ }),+ $(,)?) => {
        $(mod $module;)+

        /// Position of each effect in [`EFFECTS`].
        enum Index { $($($name,)+)+ Count }

        /// Number of effects.
        pub const COUNT: usize = Index::Count as usize;

        /// Every effect.
        pub const EFFECTS: [EffectInfo; COUNT] = [$($(<$module::$name as Effect>::INFO),+),+];

        const AT_TOOL: [bool; COUNT] = [$($(<$module::$name as Effect>::AT_TOOL),+),+];

        // of what the register knows only these reach an image
        pub(crate) const IDS: [&str; COUNT] = [$($(<$module::$name as Effect>::INFO.id),+),+];
        pub(crate) const IS_SIGNED: [bool; COUNT] = [$($(<$module::$name as Effect>::INFO.signed),+),+];
        /// Least sizes of parameters that are refused.
        pub(crate) const LIMITS: [[f64; MAX_PARAMETERS]; COUNT] = [$($(<$module::$name as Effect>::INFO.limits()),+),+];

        pub(crate) const SIZES: [Option<Size>; COUNT] = [$($(<$module::$name as Effect>::SIZE),+),+];

        impl Effects {
            /// Whether stiffness changes with temperature.
            pub fn soften_with_temperature(&self) -> bool {
                let by_element = self.elements.iter().flatten().any(|element| element.law == Law::Temperature);
                by_element $($(|| {
                    $module::$name::softening(&self.parameters[Index::$name as usize]) != [0.0; 2]
                })+)+
            }

            /// Whether limbs or platforms grow with temperature.
            pub fn grow_with_temperature(&self) -> bool {
                false $($(|| $module::$name::growth(&self.parameters[Index::$name as usize]) != [0.0; 2])+)+
            }

            /// Whether there are forces in the limbs before any load.
            pub fn preload_limbs(&self) -> bool {
                (0..3).any(|limb| {
                    false $($(|| $module::$name::tension(&self.parameters[Index::$name as usize], limb) != 0.0)+)+
                })
            }
        }

        impl<T: Scalar> ActiveEffects<T> {
            /// Adds what every active effect has inside a limb.
            #[inline(never)] // apart from the elements, so that the stack does not hold what both work with
            pub(crate) fn in_limb<const N: usize>(&self, limb: &mut Limb<'_, T, N>) {
                $($(if self.active & (1 << Index::$name as u32) != 0 {
                    $module::$name::in_limb(&self.parameters[Index::$name as usize], limb);
                })+)+
            }

            /// Adds what every element has inside a limb.
            #[inline(never)]
            pub(crate) fn elements_in_limb<const N: usize>(&self, limb: &mut Limb<'_, T, N>) {
                if self.has_elements() {
                    self.elements.in_limb(limb);
                }
            }

            /// Whether any element but at the tool is coupled.
            pub(crate) fn are_coupled(&self) -> bool {
                self.has_elements() && self.elements.are_coupled()
            }

            /// Adds what the coupled elements have between all limbs.
            pub(crate) fn couple(
                &self,
                frame: impl Fn(usize) -> LimbFrame<T>,
                length: impl Fn(usize) -> T,
                base: &Matrix3<T>,
                limbs: &mut Chain<T, 8>,
            ) {
                self.elements.coupled(frame, length, base, limbs);
            }

            /// Whether any element is a tie.
            pub(crate) fn are_ties(&self) -> bool {
                self.has_elements() && self.elements.are_ties()
            }

            /// Calls `add` with what each tie does at A per unit of its force, and its stiffness.
            pub(crate) fn ties(&self, frame: impl Fn(usize) -> LimbFrame<T>, add: impl FnMut(Vector6<T>, T)) {
                self.elements.ties(frame, add);
            }

            /// Calls `add` with what A moves by, and the compliance, of each coupled element at the tool.
            pub(crate) fn coupled_at_tool(&self, add: impl FnMut([T; 6], T)) {
                if self.has_elements() {
                    self.elements.coupled_at_tool(add);
                }
            }

            /// Whether anything active depends on the load.
            pub(crate) fn depend_on_load(&self) -> bool {
                const MASK: u32 =
                    0 $($(| if <$module::$name as Effect>::DEPENDS_ON_LOAD { 1 << Index::$name as u32 } else { 0 })+)+;
                self.active & MASK != 0 || self.has_elements() && self.elements.depend_on_load()
            }

            /// Elongation of a limb (0, 1, 2) beyond the linear one, by a tension on top of its preload.
            pub(crate) fn elongation(&self, limb: usize, tension: T) -> T {
                let before = self.tension(limb);
                self.elongation_from_zero(limb, before + tension) - self.elongation_from_zero(limb, before)
            }

            fn elongation_from_zero(&self, limb: usize, tension: T) -> T {
                let mut sum = T::ZERO;
                $($(if <$module::$name as Effect>::DEPENDS_ON_LOAD && self.active & (1 << Index::$name as u32) != 0 {
                    sum += $module::$name::elongation(&self.parameters[Index::$name as usize], tension);
                })+)+
                if self.has_elements() { sum + self.elements.elongation(limb, tension) } else { sum }
            }

            /// What lags behind the load in a limb's elongation.
            pub(crate) fn lag(&self, limb: usize, tension: T, turns: &[T]) -> T {
                let mut sum = T::ZERO;
                $($(if <$module::$name as Effect>::DEPENDS_ON_LOAD && self.active & (1 << Index::$name as u32) != 0 {
                    sum += $module::$name::lag(&self.parameters[Index::$name as usize], tension, turns);
                })+)+
                if self.has_elements() { sum + self.elements.lag(limb, tension, turns) } else { sum }
            }

            /// Tension in a limb before any load.
            pub(crate) fn tension(&self, limb: usize) -> T {
                let mut sum = T::ZERO;
                $($(if self.active & (1 << Index::$name as u32) != 0 {
                    sum += $module::$name::tension(&self.parameters[Index::$name as usize], limb);
                })+)+
                sum
            }

            /// How far A_1 and A_2, and A_3, are out of their plane.
            pub(crate) fn offset(&self) -> [T; 2] {
                let mut sum = [T::ZERO; 2];
                $($(if self.active & (1 << Index::$name as u32) != 0 {
                    let [a, b] = $module::$name::offset(&self.parameters[Index::$name as usize]);
                    sum = [sum[0] + a, sum[1] + b];
                })+)+
                sum
            }

            /// Loss of stiffness per kelvin: limb bodies, joints.
            pub(crate) fn softening(&self) -> [T; 2] {
                let mut sum = [T::ZERO; 2];
                $($(if self.active & (1 << Index::$name as u32) != 0 {
                    let [a, b] = $module::$name::softening(&self.parameters[Index::$name as usize]);
                    sum = [sum[0] + a, sum[1] + b];
                })+)+
                sum
            }

            /// Growth per kelvin: limbs, platforms.
            pub(crate) fn growth(&self) -> [T; 2] {
                let mut sum = [T::ZERO; 2];
                $($(if self.active & (1 << Index::$name as u32) != 0 {
                    let [a, b] = $module::$name::growth(&self.parameters[Index::$name as usize]);
                    sum = [sum[0] + a, sum[1] + b];
                })+)+
                sum
            }

            /// Calls `add` with the coupling of B_1 and B_2 of every active effect that has one.
            pub(crate) fn between_bases_1_2(&self, mut add: impl FnMut([T; 2])) {
                $($(if self.active & (1 << Index::$name as u32) != 0
                    && let Some(c) = $module::$name::between_bases_1_2(&self.parameters[Index::$name as usize]) {
                    add(c);
                })+)+
            }

            /// Calls `add` with the compliance shared by arms 1 and 2 of every active effect that has one.
            pub(crate) fn between_arms_1_2(&self, mut add: impl FnMut(T)) {
                $($(if self.active & (1 << Index::$name as u32) != 0
                    && let Some(c) = $module::$name::between_arms_1_2(&self.parameters[Index::$name as usize]) {
                    add(c);
                })+)+
            }

            /// Calls `add` with the compliance at B of every active effect that has one, and of the elements there.
            pub(crate) fn at_base(&self, mut add: impl FnMut([T; 6])) {
                $($(if self.active & (1 << Index::$name as u32) != 0
                    && let Some(c) = $module::$name::at_base(&self.parameters[Index::$name as usize]) {
                    add(c);
                })+)+
                if self.has_elements() {
                    self.elements.at(Place::Base, add);
                }
            }

            /// Calls `add` with the compliance between limbs and A of every active effect that has one, and of the elements there.
            pub(crate) fn at_hub(&self, mut add: impl FnMut([T; 6])) {
                $($(if self.active & (1 << Index::$name as u32) != 0
                    && let Some(c) = $module::$name::at_hub(&self.parameters[Index::$name as usize]) {
                    add(c);
                })+)+
                if self.has_elements() {
                    self.elements.at(Place::MovingPlatform, add);
                }
            }

            /// Calls `add` with the compliance at A of every active effect that has one, and of the elements there.
            pub(crate) fn at_tool(&self, mut add: impl FnMut([T; 6])) {
                $($(if self.active & (1 << Index::$name as u32) != 0
                    && let Some(c) = $module::$name::at_tool(&self.parameters[Index::$name as usize]) {
                    add(c);
                })+)+
                if self.has_elements() {
                    self.elements.at(Place::Tool, add);
                }
            }
        }
    };
}
