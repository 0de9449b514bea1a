//! `overlap`.

use super::builder::Builder;
use super::instancing::bake_within_limits;
use super::pieces::{Extent, Item, Piece, Pieces};
use super::{Layout, Options};
use crate::cost::overlap;
use crate::scene::{Bounds, Scene};

pub(super) fn overlap(scene: &Scene, options: &Options) -> Layout {
    bake_within_limits(scene, options, |selection| {
        let mut layout = Builder::new(scene);
        selection.left().for_each(|instance| layout.keep(instance));
        let pieces = Pieces::new(scene, selection);
        let mut r = Reduction::new(pieces, options);
        r.run();
        let groups: Vec<Vec<Piece>> = r.best.iter().map(|&i| r.bodies[i as usize].parts.clone()).collect();
        r.pieces.emit(&groups, &mut layout);
        layout.finish()
    })
}

#[derive(Clone)]
struct Body {
    parts: Vec<Piece>,
    bounds: Bounds,
    triangles: usize,
    splittable: bool,
}

struct Reduction<'a> {
    pieces: Pieces<'a>,
    options: &'a Options,
    bodies: Vec<Body>,
    live: Vec<u32>,
    best: Vec<u32>,
    best_ratio: f64,
}

impl<'a> Reduction<'a> {
    fn new(pieces: Pieces<'a>, options: &'a Options) -> Self {
        let bodies: Vec<Body> = pieces
            .whole()
            .into_iter()
            .map(|(p, bounds)| Body { parts: vec![p], bounds, triangles: p.len(), splittable: p.len() > options.min_triangles })
            .collect();
        let live: Vec<u32> = (0..bodies.len() as u32).collect();
        Reduction { pieces, options, best: live.clone(), live, bodies, best_ratio: f64::INFINITY }
    }

    fn run(&mut self) {
        let o = self.options;
        for round in 0..200 {
            let boxes: Vec<Bounds> = self.live.iter().map(|&i| self.bodies[i as usize].bounds).collect();
            let all: Vec<Bounds> = boxes.iter().chain(&self.pieces.others).copied().collect();
            let ratio = overlap::ratio(&all);
            let mut pairs = overlap::pairs(&boxes, o.skip_overlap_ratio * self.pieces.scene_area);
            pairs.sort_by(|a, b| b.area.total_cmp(&a.area));
            if ratio < self.best_ratio {
                self.best_ratio = ratio;
                self.best = self.live.clone();
            }
            let mut dirty = vec![false; boxes.len()];
            let mut next = Vec::new();
            let mut counts = [0; 3];
            for pair in &pairs {
                let (a, b) = (pair.a as usize, pair.b as usize);
                if dirty[a] || dirty[b] {
                    continue;
                }
                let union = boxes[a].union(&boxes[b]).area();
                let pr = pair.area / union;
                let (ia, ib) = (self.live[a], self.live[b]);
                if pr < o.split_or_merge_ratio {
                    if pr < o.split_ratio {
                        let sa = self.split(ia);
                        let sb = self.split(ib);
                        if sa.is_none() && sb.is_none() {
                            continue;
                        }
                        counts[0] += sa.is_some() as usize + sb.is_some() as usize;
                        next.extend(sa.unwrap_or(vec![ia]));
                        next.extend(sb.unwrap_or(vec![ib]));
                    } else {
                        let inside = boxes[a].intersection(&boxes[b]);
                        let sa = self.split_at(ia, &inside).or_else(|| self.split(ia).map(|v| (v, false)));
                        let sb = self.split_at(ib, &inside).or_else(|| self.split(ib).map(|v| (v, false)));
                        if sa.is_none() && sb.is_none() {
                            continue;
                        }
                        counts[1] += 1;
                        let mut merged = vec![];
                        let v2 = std::env::var("V2").is_ok() && (sa.as_ref().is_some_and(|x| x.1) || sb.as_ref().is_some_and(|x| x.1));
                        for (s, i) in [(sa, ia), (sb, ib)] {
                            match s {
                                None if v2 => merged.push(i),
                                None => next.push(i),
                                Some((v, true)) => { merged.push(v[0]); next.push(v[1]); }
                                Some((v, false)) => next.extend(v),
                            }
                        }
                        if merged.len() == 2 {
                            next.push(self.merge(merged[0], merged[1]));
                        } else { next.extend(merged); }
                    }
                } else {
                    counts[2] += 1;
                    let m = self.merge(ia, ib);
                    next.push(m);
                }
                dirty[a] = true;
                dirty[b] = true;
            }
            if std::env::var("PROBE").is_ok() {
                eprintln!("round {round}: objects {} ratio {ratio:.4} pairs {} split {} sm {} merge {}", boxes.len(), pairs.len(), counts[0], counts[1], counts[2]);
            }
            if next.is_empty() || ratio < o.termination_overlap_ratio {
                break;
            }
            let mut live: Vec<u32> = self.live.iter().enumerate().filter(|(k, _)| !dirty[*k]).map(|(_, &i)| i).collect();
            live.extend(next);
            self.live = live;
        }
    }

    fn push(&mut self, parts: Vec<Piece>) -> u32 {
        let ext = parts.iter().fold(Extent::EMPTY, |e, &p| e.union(&Extent::of(self.pieces.items(p))));
        let triangles = parts.iter().map(|p| p.len()).sum();
        self.bodies.push(Body { parts, bounds: ext.bounds(), triangles, splittable: triangles > self.options.min_triangles });
        self.bodies.len() as u32 - 1
    }

    fn divide(&mut self, i: u32, f: impl Fn(&Item) -> bool + Copy) -> Option<Vec<u32>> {
        let parts = self.bodies[i as usize].parts.clone();
        let (mut l, mut r) = (vec![], vec![]);
        for p in parts {
            let [a, b] = self.pieces.divide(p, f);
            if a.len() > 0 { l.push(a); }
            if b.len() > 0 { r.push(b); }
        }
        if l.is_empty() || r.is_empty() { return None; }
        Some(vec![self.push(l), self.push(r)])
    }

    fn split(&mut self, i: u32) -> Option<Vec<u32>> {
        let body = self.bodies[i as usize].clone();
        if !body.splittable { return None; }
        for &p in &body.parts { self.pieces.load(p); }
        let mode = std::env::var("SPLIT").unwrap_or_default();
        let cext = body.parts.iter().fold(Extent::EMPTY, |e, &p| e.union(&Extent::of_centroids(self.pieces.items(p))));
        let ext = body.parts.iter().fold(Extent::EMPTY, |e, &p| e.union(&Extent::of(self.pieces.items(p))));
        let pick = |e: &Extent| {
            let s = e.size();
            let ax = if s.x >= s.y && s.x >= s.z { 0 } else if s.y >= s.z { 1 } else { 2 };
            (ax, 0.5 * (e.min[ax] + e.max[ax]))
        };
        if mode != "c" {
            let (ax, at) = pick(&ext);
            let r = self.divide(i, |it| it.centroid[ax] < at);
            if r.is_some() { return r; }
        }
        let (ax, at) = pick(&cext);
        let r = self.divide(i, |it| it.centroid[ax] < at);
        if r.is_none() { self.bodies[i as usize].splittable = false; }
        r
    }

    fn split_at(&mut self, i: u32, inside: &Bounds) -> Option<(Vec<u32>, bool)> {
        let body = self.bodies[i as usize].clone();
        if !body.splittable { return None; }
        for &p in &body.parts { self.pieces.load(p); }
        let (mn, mx) = (inside.min.as_vec3(), inside.max.as_vec3());
        self.divide(i, |it| it.centroid.cmpge(mn).all() && it.centroid.cmple(mx).all()).map(|v| (v, true))
    }

    fn merge(&mut self, a: u32, b: u32) -> u32 {
        let (a, b) = (self.bodies[a as usize].clone(), self.bodies[b as usize].clone());
        let triangles = a.triangles + b.triangles;
        self.bodies.push(Body {
            parts: [a.parts, b.parts].concat(),
            bounds: a.bounds.union(&b.bounds),
            triangles,
            splittable: triangles > self.options.min_triangles && std::env::var("FREEZE").is_err(),
        });
        self.bodies.len() as u32 - 1
    }
}
