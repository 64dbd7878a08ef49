//! Static parameters of a hypothesis for belief filters: Θ, and the pose of an obstacle that cannot move.

use physics_model::config::ObstacleMobility;
use physics_model::theta::{ObjectShape, standard_com_m};
use pomdp::{Partition, StaticParameters};

use crate::model::{Particle, PushModel};

/// Share of an open interval at whose ends a bounded value is held, so that its logit stays finite.
const EDGE: f64 = 1e-6;
/// Height over the resting height, m, up to which a body is standing on the table.
const RESTING_TOLERANCE_M: f64 = 0.005;

/// Shapes of object and obstacle: the discrete part of Θ.
pub type Shapes = (ObjectShape, Option<ObjectShape>);

/// Cell of a hypothesis, for adaptive numbers of particles: friction and mass of the object, pose of the obstacle.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Cell {
    friction: u8,
    mass: i8,
    obstacle: Option<[i16; 2]>,
}

/// The continuous values, in a fixed order for every structure, in unconstrained coordinates:
///
/// - object: ln mass, logit of the friction coefficient, ln of the sizes that its shape has, logit of the centre of mass between the shape's
///   surfaces (all three axes of a box or cylinder; the depth below the centre of a sphere);
/// - obstacle: ln sizes; if it can move, ln mass; if not, its x, y (m) and yaw (rad), which no action changes;
/// - effects: unknown parameters as they are; one outside its limits is no world.
impl StaticParameters for PushModel {
    type Structure = Shapes;

    fn structure(&self, particle: &Particle) -> Shapes {
        (particle.theta.object.shape, particle.theta.obstacle.as_ref().map(|o| o.shape))
    }

    fn parameters(&self, particle: &Particle) -> Vec<f64> {
        let object = &particle.theta.object;
        let mut values = Vec::with_capacity(16);
        values.push(object.mass_kg.ln());
        values.push(logit(object.friction));
        values.extend(object.size_m[..object.shape.size_count()].iter().map(|size| size.ln()));
        match object.shape {
            ObjectShape::Sphere => values.push(logit(-object.com_m[2] / object.size_m[0])),
            shape => {
                for (com, half) in object.com_m.iter().zip(shape.half_extents_m(object.size_m)) {
                    values.push(logit(0.5 * (1.0 + com / half)));
                }
            }
        }
        if let (Some(obstacle), Some(body)) = (&particle.theta.obstacle, &particle.state.obstacle) {
            values.extend(obstacle.size_m[..obstacle.shape.size_count()].iter().map(|size| size.ln()));
            match self.config().world.obstacle_mobility {
                ObstacleMobility::Movable => values.push(obstacle.mass_kg.ln()),
                ObstacleMobility::Fixed => values.extend([body.position_m[0], body.position_m[1], body.yaw_rad()]),
            }
        }
        values.extend(particle.theta.effects.iter().map(|effect| effect.value));
        values
    }

    fn with_parameters(&self, particle: &Particle, parameters: &[f64]) -> Option<Particle> {
        if parameters.iter().any(|value| !value.is_finite()) {
            return None;
        }
        let mut next = particle.clone();
        let mut values = parameters.iter().copied();
        let table_m = self.config().world.table_height_m;
        let object = &mut next.theta.object;
        let stands = stands(particle.state.object.position_m[2], table_m, object.shape, object.size_m);
        object.mass_kg = values.next()?.exp();
        object.friction = expit(values.next()?);
        for size in &mut object.size_m[..object.shape.size_count()] {
            *size = values.next()?.exp();
        }
        match object.shape {
            ObjectShape::Sphere => object.com_m = [0.0, 0.0, -expit(values.next()?) * object.size_m[0]],
            shape => {
                let half = shape.half_extents_m(object.size_m);
                for (com, half) in object.com_m.iter_mut().zip(half) {
                    *com = (2.0 * expit(values.next()?) - 1.0) * half;
                }
            }
        }
        object.com_m = standard_com_m(object.shape, object.com_m);
        if stands {
            next.state.object.position_m[2] = table_m + object.shape.half_height_m(object.size_m);
        }
        if let (Some(obstacle), Some(body)) = (&mut next.theta.obstacle, &mut next.state.obstacle) {
            let stands = self::stands(body.position_m[2], table_m, obstacle.shape, obstacle.size_m);
            for size in &mut obstacle.size_m[..obstacle.shape.size_count()] {
                *size = values.next()?.exp();
            }
            match self.config().world.obstacle_mobility {
                ObstacleMobility::Movable => obstacle.mass_kg = values.next()?.exp(),
                ObstacleMobility::Fixed => {
                    body.position_m[0] = values.next()?;
                    body.position_m[1] = values.next()?;
                    let (sin, cos) = (0.5 * values.next()?).sin_cos();
                    body.orientation = [0.0, 0.0, sin, cos];
                }
            }
            if stands {
                body.position_m[2] = table_m + obstacle.shape.half_height_m(obstacle.size_m);
            }
        }
        for effect in &mut next.theta.effects {
            effect.value = values.next()?;
        }
        if values.next().is_some() {
            return None;
        }
        self.check(&next).is_ok().then_some(next)
    }
}

impl Partition for PushModel {
    type Cell = Cell;

    fn cell(&self, particle: &Particle) -> Cell {
        let object = &particle.theta.object;
        Cell {
            // A tenth of friction, half an octave of mass, 2 cm of the obstacle's place: what makes a push end elsewhere.
            friction: (10.0 * object.friction) as u8,
            mass: (2.0 * object.mass_kg.log2()).floor() as i8,
            obstacle: particle.state.obstacle.as_ref().map(|body| {
                let bin = |metres: f64| (metres / 0.02).floor() as i16;
                [bin(body.position_m[0]), bin(body.position_m[1])]
            }),
        }
    }
}

fn stands(z_m: f64, table_m: f64, shape: ObjectShape, size_m: [f64; 3]) -> bool {
    (z_m - table_m - shape.half_height_m(size_m)).abs() < RESTING_TOLERANCE_M
}

fn logit(share: f64) -> f64 {
    let share = share.clamp(EDGE, 1.0 - EDGE);
    (share / (1.0 - share)).ln()
}

fn expit(value: f64) -> f64 {
    1.0 / (1.0 + (-value).exp())
}
