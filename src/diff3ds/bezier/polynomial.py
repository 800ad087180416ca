"""Real roots of the polynomials that curves lead to, on [-1, 1], isolated by isolator polynomials."""

import torch

from diff3ds._shapes import Bool, Float, Tensor

# Newton-Raphson needs about six steps from a bracket; when it does not help, 60 bisections reach the last bit.
MAX_STEPS = 70


def polyval(coefficients: Float[Tensor, "*B C"], x: Float[Tensor, "*B M"]) -> Float[Tensor, "*B M"]:
    """Value at x of the polynomials with ascending coefficients, by Horner's rule."""
    value = coefficients[..., -1:].expand(x.shape)
    for k in range(coefficients.shape[-1] - 2, -1, -1):
        value = value * x + coefficients[..., k : k + 1]
    return value


def derivative(coefficients: Float[Tensor, "*B C"]) -> Float[Tensor, "*B C1"]:
    """Ascending coefficients of the derivative; a constant has the derivative [0]."""
    order = torch.arange(1, coefficients.shape[-1], dtype=coefficients.dtype)
    if len(order) == 0:
        return torch.zeros_like(coefficients)
    return coefficients[..., 1:] * order.to(coefficients.device)


def multiply(a: Float[Tensor, "*B1 C1"], b: Float[Tensor, "*B2 C2"]) -> Float[Tensor, "*B3 C3"]:
    """Ascending coefficients of the product of two polynomials; the batch axes broadcast."""
    n = b.shape[-1]
    # `torch.broadcast_shapes` takes seconds when it is first called: it imports sympy.
    batch = torch.broadcast_tensors(a[..., :1], b[..., :1])[0].shape[:-1]  # type: ignore[no-untyped-call]
    product = a.new_zeros((*batch, a.shape[-1] + n - 1))
    for k in range(a.shape[-1]):
        product[..., k : k + n] += a[..., k : k + 1] * b
    return product


def isolators(p: Float[Tensor, "*B C"]) -> tuple[Float[Tensor, "*B Ca"], Float[Tensor, "*B Cb"]]:
    """Isolator polynomials a, b of p (degree 4: a quadratic and a line; degree 7: two cubics).

    a = b p' + c p with b and c of the lowest degrees that let a have a low degree too. Between two neighbouring
    real roots of p, p' changes sign, hence so does b or a: a root of a or of b lies between them (Sederberg and
    Chang, "Isolator polynomials", 1993; appendix C.3 of the Diff3DS paper). The coefficients are the null vector
    of the homogeneous system "the high coefficients of b p' + c p are zero", so nothing is divided by a leading
    coefficient that may vanish. Where b vanishes, a = c p keeps the roots of p, and conversely.
    """
    degree = p.shape[-1] - 1
    b_degree = {4: 1, 7: 3}[degree]
    a_degree = degree - 1 - b_degree
    dp = derivative(p)
    # Column i < b_degree + 1 holds the coefficients of x^i p', the others those of x^i p.
    columns = p.new_zeros((*p.shape[:-1], degree + b_degree, 2 * b_degree + 1))
    for i in range(b_degree + 1):
        columns[..., i : i + degree, i] = dp
    for i in range(b_degree):
        columns[..., i : i + degree + 1, b_degree + 1 + i] = p
    high = columns[..., a_degree + 1 :, :]
    # The last column of a complete QR of the transpose is orthogonal to every row, whatever the rank.
    null = torch.linalg.qr(high.mT, mode="complete").Q[..., -1]
    a = (columns[..., : a_degree + 1, :] @ null[..., None])[..., 0]
    return a, null[..., : b_degree + 1]


def separators(p: Float[Tensor, "*B C"]) -> Float[Tensor, "*B S"]:
    """Sorted points of [-1, 1] with at most one real root of p between two neighbours (multiple roots lie on one)."""
    degree = p.shape[-1] - 1
    if degree == 1:
        return p.new_zeros((*p.shape[:-1], 0))
    parts = [derivative(p)] if degree in (2, 3) else isolators(p)
    points = torch.cat([real_roots(part) for part in parts], -1)
    return torch.where(points.isnan(), 1.0, points).sort(-1).values


def roots_and_separators(p: Float[Tensor, "*B C"]) -> tuple[Float[Tensor, "*B M"], Float[Tensor, "*B S"]]:
    """As `real_roots`, together with the points that separate the roots.

    Multiple roots, and all roots where two or more leading coefficients of p vanish (then an isolator is a multiple of
    p), may be among the separators alone: rounding decides.
    """
    scale = p.abs().amax(-1, keepdim=True)
    p = p / torch.where(scale > 0, scale, 1.0)
    if p.shape[-1] == 2:
        root = -p[..., :1] / torch.where(p[..., 1:] == 0, torch.nan, p[..., 1:])
        return torch.where(root.abs() <= 1, root, torch.nan), p[..., :0]
    inner = separators(p)
    ends = p.new_ones((*p.shape[:-1], 1))
    points = torch.cat([-ends, inner, ends], -1)
    values = polyval(p, points)
    bracketed = values[..., :-1].sign() * values[..., 1:].sign() <= 0
    roots = torch.full_like(points[..., :-1], torch.nan)
    rows = p[..., None, :].expand(*bracketed.shape, p.shape[-1])[bracketed]
    roots[bracketed] = bracketed_roots(rows, points[..., :-1][bracketed], points[..., 1:][bracketed])
    return roots, inner


def real_roots(p: Float[Tensor, "*B C"]) -> Float[Tensor, "*B M"]:
    """The real roots in [-1, 1] at which polynomials of degree 1, 2, 3, 4 or 7 change sign; float64, ascending
    coefficients. For all roots without exception see `roots_and_separators`.

    Unused places hold NaN. A root that coincides with a separating point may be listed twice. The zero polynomial,
    every x of which is a root, gives points of [-1, 1] or NaN, whichever comes.
    """
    return roots_and_separators(p)[0]


def bracketed_roots(
    p: Float[Tensor, "R C"], low: Float[Tensor, " R"], high: Float[Tensor, " R"]
) -> Float[Tensor, " R"]:
    """One root in each bracket by Newton-Raphson, falling back on bisection when a step leaves the bracket."""
    dp = derivative(p)

    def at(c: Float[Tensor, "R2 C2"], x: Float[Tensor, " R2"]) -> Float[Tensor, " R2"]:
        return polyval(c, x[:, None])[:, 0]

    rising = at(p, high) >= at(p, low)
    below, above = torch.where(rising, low, high), torch.where(rising, high, low)  # p(below) <= 0 <= p(above)
    x = (low + high) / 2
    root = x.clone()
    active = torch.arange(len(x), device=x.device)
    for _ in range(MAX_STEPS):
        if len(active) == 0:
            break
        value, slope = at(p, x), at(dp, x)
        below, above = torch.where(value <= 0, x, below), torch.where(value >= 0, x, above)
        newton = x - value / torch.where(slope == 0, torch.nan, slope)
        inside = (newton - below) * (newton - above) < 0
        following = torch.where(inside, newton, (below + above) / 2)
        # Newton that converges from one side leaves the bracket long: bisect when the step does not halve it.
        slow = (following - x).abs() > 0.5 * (above - below).abs()
        following = torch.where(slow, (below + above) / 2, following)
        root[active] = following
        moving: Bool[Tensor, " R"] = ((following - x).abs() > 1e-16) & (value != 0)
        x, below, above, p, dp = (v[moving] for v in (following, below, above, p, dp))
        active = active[moving]
    return root
