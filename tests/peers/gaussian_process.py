"""What scikit-learn makes of eight points, for the test of crates/diagnose-benchmark/src/gaussian_process.rs.

    pip install scikit-learn==1.9.1
    python tests/peers/gaussian_process.py

The covariance and the grid are those of that file; the scale is looked for by a fine search instead of its closed form.
"""

import numpy as np
from scipy.optimize import minimize_scalar
from sklearn.gaussian_process import GaussianProcessRegressor
from sklearn.gaussian_process.kernels import RBF, ConstantKernel, WhiteKernel

i = np.arange(8)
x = np.stack([0.3 * i, (i * i) % 5], axis=1)
y = np.sin(2 * x[:, 0]) + 0.1 * x[:, 1] + 0.5
new = np.array([[0.4, 2.0], [3.0, 1.0]])
centre, scale = x.mean(axis=0), x.std(axis=0)
standard = lambda x: (x - centre) / scale


def process(length, noise, variance):
    kernel = ConstantKernel(variance) * (ConstantKernel(1.0) + RBF(length * np.sqrt(2))) + WhiteKernel(variance * noise)
    return GaussianProcessRegressor(kernel, optimizer=None, alpha=1e-12).fit(standard(x), y)


def best(length, noise):
    evidence = lambda log: -process(length, noise, np.exp(log)).log_marginal_likelihood_value_
    found = minimize_scalar(evidence, bounds=(-8, 8), method="bounded", options={"xatol": 1e-9})
    return -found.fun, length, noise, np.exp(found.x)


evidence, length, noise, variance = max(best(l, n) for l in (0.25, 0.5, 1, 2, 4) for n in (0.001, 0.01, 0.1, 1, 10))
print("length", length, "noise", noise, "variance", variance, "ln evidence", evidence)
print("means", process(length, noise, variance).predict(standard(new)))
