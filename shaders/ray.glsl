// A ray in the units of the structures.
Ray scaled(Ray ray, float scale) {
    return Ray(ray.origin * scale, ray.t_min * scale, ray.direction, ray.t_max * scale);
}

// Whether a ray may be traced: others have no defined result, and count as misses.
bool is_sound(Ray ray) {
    bool numbers = !any(isnan(ray.origin)) && !any(isinf(ray.origin))
        && !any(isnan(ray.direction)) && !any(isinf(ray.direction));
    return numbers && ray.t_min >= 0.0 && ray.t_min <= ray.t_max && any(notEqual(ray.direction, vec3(0.0)));
}
