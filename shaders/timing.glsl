// What a ray brings back while it is timed.
struct Timed {
    float t;
    uint any_hits;
};
