// Sines and cosines by additions and multiplications alone, up to 800 rad: within 1 ulp where sums are
// rounded as they are written. Line by line what the file in C does with floats; beyond, what the language
// has.

// sin r = r + r^3 * (...), cos r = 1 - r^2/2 + r^4 * (...) for |r| <= pi/4, interpolated at Chebyshev points.
fn sine_series(z: f32) -> f32 {
    let square = z * z;
    return (-0.1666666716337204f + (z * 0.008333331905305386f))
        + (square * (-0.00019840082677546889f + (z * 2.7249313916399842e-06f)));
}

fn cosine_series(z: f32) -> f32 {
    let square = z * z;
    return (0.0416666641831398f + (z * -0.0013888300163671374f)) + (square * 2.4547436623834074e-05f);
}

// The sine and the cosine.
fn sin_cos(angle: f32) -> vec2<f32> {
    if (abs(angle) > 800.0f) {
        return vec2<f32>(sin(angle), cos(angle));
    }
    // Quarter turns, and what is left of the angle in two parts: products with the first two parts of pi/2
    // are exact (Cody and Waite). Rounded by name: a compiler may leave out what is added and taken away
    // again.
    let quarters = round(angle * 0.63661977236758134308f);
    let near_zero = angle - (quarters * 1.57080078125f);
    let part = quarters * -4.4545158743858337402e-6f;
    let r = near_zero - part;
    let tail = ((near_zero - r) - part) - (quarters * 6.0771006282767103812e-11f);
    let turns = quarters - (4.0f * round(quarters * 0.25f));
    let z = r * r;
    let half = 0.5f * z;
    let near = 1.0f - half;
    let s = r + ((tail * near) + ((z * r) * sine_series(z)));
    let c = near + (((1.0f - near) - half) + (((z * z) * cosine_series(z)) - (r * tail)));
    // Products and sums with whole quarter turns, -2 ... 2, are exact.
    let along = 1.0f - abs(turns);
    let across = turns + (turns * along);
    return vec2<f32>((s * along) + (c * across), (c * along) - (s * across));
}
